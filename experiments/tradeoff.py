"""What does accuracy cost on `kodama`, for every method and every accuracy setting of the job
(`camopt tradeoff kodama --cam polydyne`)?

The experiment runs `camopt tradeoff` on `kodama` (small: its small size on `motori-1`) for table and figures. At full
size it also measures the effect of single precision on the same motion (float32 against float64 with the same steps and
layer, for one speed and for a batch of speeds), and the gradient by the adjoint and by reverse mode.
"""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.plots.studies import figures
from camopt.scene import load_scene
from camopt.scene.units import MM, UM
from camopt.storage.journal import Records
from camopt.study.measurements import measured
from camopt.study.tradeoff.tradeoff import LINES, or_failure, rows_of, tables_of, tradeoff
from experiments.support.record import RESULTS, run_script, write_result

SCENE = {"small": "motori-1", "full": "kodama"}


def rounding(lines: list[dict]) -> list[dict]:
    """By setting: change of the valve's lift by float32 [um], error of float64 [um], and ratio of the times."""
    references = {line["case"]: line for line in lines if line["method"] == "reference"}
    rows = []
    for line in lines:
        if "float32" not in line["method"] or line["failure"]:
            continue
        key = line["case"], line["method"].replace("float32", "float64"), line["setting"]
        (double,) = (row for row in lines if (row["case"], row["method"], row["setting"]) == key)
        single, wide, true = (
            np.array(one["figures"]["lift_mm"]) * MM / UM for one in (line, double, references[line["case"]])
        )
        rows.append(
            {
                "case": line["case"],
                "setting": line["setting"],
                "float32_moves_lift_um": float(np.abs(single - wide).max()),
                "float64_error_um": float(np.abs(wide - true).max()),
                "time_ratio": line["seconds"] / double["seconds"],
            }
        )
    return rows


def main(size: str, folder: Path = RESULTS) -> dict:
    """Measures in a scratch folder, and writes table and figures into `folder`."""
    scene, more = load_scene(SCENE[size]), []
    cam = polydyne(scene)
    with tempfile.TemporaryDirectory() as scratch:
        study = tradeoff(scene, Path(scratch) / "run", size=size, progress=size == "full", cam=cam)
        if size == "full":
            from experiments.support.smooth_costs import smooth_work

            work = [or_failure(one) for one in smooth_work(scene, cam)]
            more = measured(Records(None, "case", "method", "setting"), work, progress=True)
        return keep(study.folder, size, folder, more)


def keep(run: Path, size: str, folder: Path = RESULTS, more: Sequence[dict] = ()) -> dict:
    """Writes `tradeoff.json` and `tradeoff-<figure>.png` from the measurements of a run and from additional ones."""
    lines = [*(json.loads(line) for line in (run / LINES).read_text(encoding="utf-8").splitlines()), *more]
    rows = rows_of(lines)
    short = [{k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in row.items()} for row in rows]
    content = {"float32": rounding(lines), "rows": short}
    print("\n\n".join("\n".join(table) for table in tables_of(rows).values()))
    return write_result("tradeoff", size, content, figures(rows) if size == "full" else {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
