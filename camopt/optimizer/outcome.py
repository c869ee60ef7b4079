"""What an optimisation ends in: folder, cam, verdict and figures, and how a notebook shows them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from camopt.cam.lift import Lift
from camopt.verifier.verdict import Verdict

if TYPE_CHECKING:
    from camopt.optimizer.as_built.statement import YieldStatement

SHOWN = ("area_ratio", "area_ratio_bound", "area_gap_percent", "area_ratio_no_jump", "gradient_gain")
"""Figures of the record that a notebook shows above the verdict."""


@dataclass(frozen=True, repr=False)
class Run:
    """The outcome of an optimisation: where it lies, the cam, its verdict, and the figures of `design.json`."""

    folder: Path
    lift: Lift
    verdict: Verdict
    record: dict
    exit_code: int  # 0 confirmed, 3 not
    as_built: "YieldStatement | None" = None  # what drawn trains say; None where the scene says not how they differ

    def __repr__(self) -> str:
        built = "" if self.as_built is None else f", {self.as_built.share} of trains as built"
        return f"Run({self.verdict.verdict}, area ratio {self.record['area_ratio']:.5f}{built}, {self.folder})"

    def plot(self):
        """Bounce and jump against speed as a matplotlib Figure."""
        return self.verdict.plot()

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        rows = {name.replace("_", " "): self.record[name] for name in SHOWN} | {"run folder": str(self.folder)}
        table = DataFrame([rows.keys(), rows.values()]).T
        shown = table.to_html(index=False, header=False, float_format="{:.5f}".format)
        built = "" if self.as_built is None else f"<p>{self.as_built._repr_html_()}</p>"
        return shown + built + self.verdict._repr_html_()
