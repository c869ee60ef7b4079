"""The main job: bound, no-jump program, gradient stage, verdict by independent methods, comparison, run folder."""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from camopt.cam.design_file import design_record
from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.optimizer.accuracy import Accuracy, accuracy_named
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.program.kinematic import kinematic_optimum, limit_worth
from camopt.optimizer.program.no_jump import NoJumpOptimum
from camopt.optimizer.search.journal import Journal
from camopt.optimizer.search.search import find_cam
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.toml_text import scene_toml
from camopt.scene.train import build_train
from camopt.scene.units import MM
from camopt.storage import default_run_folder, run_folder, run_identity, write_json, write_text
from camopt.verifier.verdict import Verdict, verdict_on

PACKAGES = ("camopt", "jax", "diffrax", "optax", "numpy", "scipy", "highspy", "numba", "matplotlib")
SPEEDS = ("band", "nominal")
GRADIENTS = ("smooth", "exact", "none")
SHOWN = ("area_ratio", "area_ratio_bound", "area_gap_percent", "area_ratio_no_jump", "gradient_gain")
"""Figures of the record that a notebook shows above the verdict."""
CANDIDATES = 4
"""Confirmed cams of the search, largest first, that the full verdict may be asked about."""


@dataclass(frozen=True, repr=False)
class Run:
    """The outcome of an optimisation: where it lies, the cam, its verdict, and the figures of `design.json`."""

    folder: Path
    lift: Lift
    verdict: Verdict
    record: dict
    exit_code: int  # 0 confirmed, 3 not

    def __repr__(self) -> str:
        return f"Run({self.verdict.verdict}, area ratio {self.record['area_ratio']:.5f}, {self.folder})"

    def plot(self):
        """Bounce and jump against speed as a matplotlib Figure."""
        return self.verdict.plot()

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        rows = {name.replace("_", " "): self.record[name] for name in SHOWN} | {"run folder": str(self.folder)}
        table = DataFrame([rows.keys(), rows.values()]).T.to_html(
            index=False, header=False, float_format="{:.5f}".format
        )
        return table + self.verdict._repr_html_()


def optimize(
    scene: Scene,
    speeds: str = "band",
    accuracy: str = "standard",
    gradient: str = "smooth",
    out: Path | str | None = None,
    seed: int = 0,
    resume: bool = False,
    progress: bool = False,
    designed: Callable[[Path], object] = lambda folder: None,
) -> Run:
    """Design the cam of largest area that a scene's limits allow, and have it verified and compared.

    `speeds` "band" (every speed of the scene's band) or "nominal" (its listed speeds (k) [r/min]); `accuracy` a name of
    `camopt.optimizer.accuracy`; `gradient` "smooth", "exact" or "none". The run folder (docs/run-folder.md) goes to
    `out` (default runs/<scene>-<UTC time>), but for report.html, which `camopt.report` makes from it. With `resume`
    an interrupted run in `out` goes on and ends in the same design. `seed`, where it is not zero, draws the knots to
    start from. `designed` is called with the folder once the design, its verdict and its provenance are written, before
    the comparison, which can cost none of them. Raises InputError for unknown words, contradictory limits, an unusable
    folder or one of another run, and a scene without a confirmed cam.
    """
    begun = time.perf_counter()
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    effort = accuracy_named(accuracy)
    for name, value, known in (("speeds", speeds, SPEEDS), ("gradient", gradient, GRADIENTS)):
        if value not in known:
            raise InputError(f"{name} {value!r}: expected one of {', '.join(known)}")
    build_train(scene).require_linear(
        "the optimiser", "optimise a scene with linear laws and verify its cam on this one"
    )
    kinematic = kinematic_optimum(design, free_cam(design, effort.knot_deg))  # contradictory limits end here
    certificate = area_ratio_bound(design)
    settings = {"speeds": speeds, "accuracy": accuracy, "gradient": gradient, "seed": seed}
    identity = run_identity("optimize", scene, **settings)
    with run_folder(out or default_run_folder(scene.name), identity, resume, ["design.json"]) as folder:
        write_text(folder / "scene.toml", scene_toml(scene))
        with _Progress(progress, effort, gradient) as shown:
            times = {"bound": time.perf_counter() - begun}
            search, no_jump = find_cam(scene, speeds, effort, gradient, Journal(folder), shown.step, times, seed=seed)
            shown.stage("verdict")
            started = time.perf_counter()
            chosen, verdict, refused = confirmed_cam(scene, search.confirmed, speeds, effort)
            times["verdict"] = time.perf_counter() - started
        record = design_record(
            chosen.lift,
            design.max_lift_mm * MM,
            area_ratio_bound=certificate.bound,
            area_gap_percent=100 * (certificate.bound - chosen.area_ratio) / certificate.bound,
            area_ratio_no_jump=no_jump.area_ratio,
            gradient_gain=chosen.area_ratio - no_jump.area_ratio,
            verdict_fell_back=fallen_back(chosen, refused),
            limit_worth=limit_worth(kinematic),
        )
        write_json(folder / "design.json", record)
        write_lift_table(folder / "lift.csv", chosen.lift)
        write_json(folder / "verification.json", verdict.as_dict())
        times["total"] = time.perf_counter() - begun
        write_json(folder / "provenance.json", _provenance(settings, times, search.judge.calls))
        designed(folder)
        from camopt.optimizer.baselines.comparison import (
            compare_in,  # draws figures: loaded only once there is a design
        )

        started = time.perf_counter()
        compare_in(folder, scene, {"design": chosen.lift}, {"design": verdict}, effort)
        times |= {"comparison": time.perf_counter() - started, "total": time.perf_counter() - begun}
        write_json(folder / "provenance.json", _provenance(settings, times, search.judge.calls))
    return Run(folder, chosen.lift, verdict, record, 0 if verdict.verdict == "confirmed" else 3)


def full_verdict(scene: Scene, lift: Lift, speeds: str, effort: Accuracy) -> Verdict:
    """The verdict on a run's design: at the listed speeds and, with `speeds` "band", over the band."""
    asked = effort.verdict
    band_step = asked.band_step_rpm if speeds == "band" else None
    return verdict_on(scene, lift, None, asked.methods, band_step, asked.tolerance_um)


def confirmed_cam(
    scene: Scene, candidates: list[NoJumpOptimum], speeds: str, effort: Accuracy
) -> tuple[NoJumpOptimum, Verdict, list[NoJumpOptimum]]:
    """The largest candidate that the full verdict confirms, and those that it refused before.

    Where none is confirmed, the largest one with its own verdict and all that were judged.
    """
    first, refused = None, []
    for found in candidates[::-1][:CANDIDATES]:
        verdict = full_verdict(scene, found.lift, speeds, effort)
        first = first or (found, verdict)
        if verdict.verdict == "confirmed":
            return found, verdict, refused
        refused.append(found)
    assert first is not None, "a search that ends has a confirmed cam"
    return *first, refused


def fallen_back(chosen: NoJumpOptimum, refused: list[NoJumpOptimum]) -> dict:
    """Whether the verdict had to go back to a smaller cam: cams it judged, and the largest area ratio it refused."""
    judged = len(refused) + (not any(found is chosen for found in refused))
    largest = max((found.area_ratio for found in refused), default=None)
    return {"candidates_judged": judged, "largest_refused_area_ratio": largest}


def _provenance(settings: dict, times: dict, judged: int) -> dict:
    return {
        "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
        "machine": {"processor": platform.machine(), "system": platform.system()},
        "settings": settings,
        "seed": settings["seed"],
        "cams_judged": judged,
        "times_s": {name: round(value, 3) for name, value in times.items()},
        "finished_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


class _Progress:
    """A bar over the search's steps with stage, best area and worst bounce; silent where not wanted."""

    def __init__(self, wanted: bool, effort: Accuracy, gradient: str):
        steps = 8 + effort.margin_draws + (effort.gradient_steps if gradient != "none" else 0)
        self._bar = tqdm(total=steps + 1, disable=None if wanted else True, unit="step", dynamic_ncols=True)

    def __enter__(self) -> "_Progress":
        return self

    def __exit__(self, *exception) -> None:
        self._bar.update(self._bar.total - self._bar.n)
        self._bar.close()

    def stage(self, name: str) -> None:
        self._bar.set_description(name)

    def step(self, line: dict) -> None:
        self._bar.set_description(line["stage"])
        best = line["best_area_ratio"]
        self._bar.set_postfix_str(
            ("no confirmed cam yet" if best is None else f"best area ratio {best:.4f}")
            + f", bounce {line['worst_bounce_mm']:.3f} mm, worst at {line['worst_speed_rpm']:.0f} r/min"
        )
        self._bar.update(1)
