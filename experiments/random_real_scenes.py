"""Does any of 24 drawn trains of real elements end in a wrong number without a warning?

As `experiments.random_scenes`, from the built-in trains with springs by tables, adjusters, friction, nested springs
and gas forces, every number of them moved, among them leakage, slip, tables and forces. Where a law is curved,
event-exact has chords that are refined with its steps, and the methods of constant matrices refuse.
"""

from tqdm import tqdm

from camopt.cam.families.polydyne import polydyne
from camopt.scene import load_scene
from camopt.study.extremes.classification import WRONG
from experiments.random_scenes import REAL, against_dop853, judged, keep, most_doubtful
from experiments.support.record import RESULTS, run_script

SCENES = {"small": 3, "full": 24}
DECIDED = {"small": 1, "full": 4}


def main(size: str, folder=RESULTS) -> dict:
    """Draws, judges, decides, prints and writes `random_real_scenes.json`."""
    kodama = load_scene("kodama")
    cams = [polydyne(kodama), polydyne(kodama, (2, 4, 26, 30, 36))]
    rows = [judged(REAL + i, cams) for i in tqdm(range(SCENES[size]), disable=size == "small")]
    doubtful = most_doubtful(rows)[: DECIDED[size]]
    suspects = [r for r in rows if r["verdict"] == WRONG and r not in doubtful]
    decided = [{"number": r["number"], **against_dop853(r["number"], cams)} for r in doubtful + suspects]
    return keep(rows, decided, size, folder, "random_real_scenes")


if __name__ == "__main__":
    run_script(main, __doc__)
