"""What does each accuracy cost on the reference valve train, by every method and every dial of the job?

`camopt tradeoff` on `kodama` (small: the small size on `motori-1`): table, figures and words. Beside it what single
precision changes of the same motion: float32 against float64 at the same steps and layer, alone and side by side.
"""

import csv
import json
import tempfile
from pathlib import Path

import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.plots.tradeoff import figures
from camopt.scene import load_scene
from camopt.scene.units import MM, UM
from camopt.study.tradeoff.summary import words_of
from camopt.study.tradeoff.tradeoff import LINES, tradeoff
from experiments.support.record import RESULTS, run_script, write_result

SCENE = {"small": "motori-1", "full": "kodama"}


def rounding(lines: list[dict]) -> list[dict]:
    """By setting: how far float32 moves the valve's lift [um], how far float64 is from the truth, ratio of times."""
    references = {line["case"]: line for line in lines if line["method"] == "reference"}
    rows = []
    for line in lines:
        if "float32" not in line["method"] or line["failure"]:
            continue
        key = line["case"], line["method"].replace("float32", "float64"), line["setting"]
        (double,) = (other for other in lines if (other["case"], other["method"], other["setting"]) == key)
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
    """Measures in a scratch folder; keeps table, figures and words in `folder`."""
    scene = load_scene(SCENE[size])
    with tempfile.TemporaryDirectory() as scratch:
        found = tradeoff(scene, Path(scratch) / "run", size=size, progress=size == "full", cam=polydyne(scene))
        return keep(found.folder, size, folder)


def keep(run: Path, size: str, folder: Path = RESULTS) -> dict:
    """Writes `tradeoff.json` and `tradeoff-<figure>.png` from the table of a run."""
    with open(run / "tradeoff.csv", newline="", encoding="utf-8") as file:
        rows = [_numbers(row) for row in csv.DictReader(file)]
    lines = [json.loads(line) for line in (run / LINES).read_text(encoding="utf-8").splitlines()]
    short = [{k: float(f"{v:.4g}") if isinstance(v, float) else v for k, v in row.items()} for row in rows]
    content = {"words": words_of(SCENE[size], rows), "float32": rounding(lines), "rows": short}
    print(content["words"])
    for row in content["float32"]:
        print(", ".join(f"{k} {v:.3g}" if isinstance(v, float) else v for k, v in row.items()))
    write_result("tradeoff", size, content, figures(rows) if size == "full" else {}, folder)
    return content


def _numbers(row: dict) -> dict:
    empty_or_number = {key: float(row[key]) if row[key] else None for key in ("error", "seconds")}
    return {**row, **empty_or_number, "converged": row["converged"] == "True"}


if __name__ == "__main__":
    run_script(main, __doc__)
