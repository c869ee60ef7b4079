"""Does any method give a wrong result without a warning on the fixed list of extreme cases of any built-in scene?

The cases are those of `camopt extremes`, on every scene with a motion (on `kodama` also pairs of extremes). Rows are
stored in `runs/extremes`, from which an interrupted run resumes. The small size is the unchanged scene `motori-2`.
"""

import tempfile
from collections import Counter
from pathlib import Path

from camopt.plots.studies import verdict_matrix
from camopt.scene import load_scene
from camopt.study.extremes import extremes as study
from camopt.study.extremes.cases import AS_IT_IS
from experiments.support.record import RESULTS, run_script, write_result

REAL = ("exhaust-gas", "finger-hydraulic", "pushrod-hydraulic", "race-nested")
SCENES = {"small": ("motori-2",), "full": ("kodama", "kodama-hertz", "motori-1", "motori-2", "pushrod-5mass", *REAL)}
RUN = Path("runs") / "extremes"


def main(size: str, folder=RESULTS) -> dict:
    """Runs the list of cases, prints the counts and writes `extremes.json`, at full size with a figure per scene."""
    scenes = [load_scene(name) for name in SCENES[size]]
    if size == "full":
        rows = study.extremes(scenes, RUN, resume=RUN.exists())
    else:
        with tempfile.TemporaryDirectory() as scratch:
            rows = study.extremes(scenes, scratch, resume=True, progress=False, named=(AS_IT_IS,))
    by_scene = {s.name: [r for r in rows if r["case"].startswith(f"{s.name}: ")] for s in scenes}
    content = {
        "rows": len(rows),
        "wrong": [f"{r['case']}, {r['method']}" for r in study.defects(rows)],
        "by_scene": {name: dict(Counter(r["verdict"] for r in group)) for name, group in by_scene.items()},
        "by_method": study.counts(rows),
        "seconds": {name: sum(float(r["seconds"] or 0) for r in group) for name, group in by_scene.items()},
        "verdicts": {name: _by_case(name, group) for name, group in by_scene.items()},
    }
    figures = {name: verdict_matrix(group, name) for name, group in by_scene.items()} if size == "full" else {}
    return write_result("extremes", size, content, figures, folder)


def _by_case(scene: str, rows: list[dict]) -> dict[str, dict[str, str]]:
    verdicts: dict[str, dict[str, str]] = {}
    for row in rows:
        verdicts.setdefault(row["case"].removeprefix(f"{scene}: "), {})[row["method"]] = row["verdict"]
    return verdicts


if __name__ == "__main__":
    run_script(main, __doc__)
