"""Is the yield that a job states correct: does its interval cover the true yield, and do independent methods agree
about single trains?

Cams and yield statements are those of jobs at the default accuracy, at small size of draft jobs. The first 20 trains of
each statement are verified by the verdict's methods at the speed at which each train has its largest ratio to a limit.
The interval is tested on a population of trains, from which many statements are simulated with newly sampled trains:
the share of their intervals that contain the population's yield is the coverage.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.measure.yields import share_of
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built.measured import track
from camopt.optimizer.as_built.statement import by_independent_methods, looks_of, statement_of_run
from camopt.optimizer.run import optimize
from camopt.scene import Scene, load_scene
from experiments.support.record import RESULTS, run_script, write_result

SCENES = {"small": ("motori-1",), "full": ("motori-1", "kodama", "pushrod-5mass", "finger-hydraulic")}
JUDGED = {"small": 3, "full": 20}
POPULATION = {"small": 60, "full": 4000}
REPETITIONS = 200
ACCURACY = {"small": "draft", "full": "standard"}
POPULATION_SEED = 4_000_037
"""Seed of the population, which no search and no statement uses."""


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """The statement on each scene's cam with its independent verification, and the coverage of the interval."""
    content: dict = {"judged": JUDGED[size], "repetitions": REPETITIONS, "scenes": {}}
    for name in SCENES[size]:
        scene = load_scene(name)
        lift = designed(scene, size)
        content["scenes"][name] = row = judged(scene, lift, size)
        print(f"{name}: {row['differs']} of {row['judged']} verdicts differ, {row['open']} are left open")
        if name == SCENES[size][0]:
            content["coverage"] = tested = coverage(scene, lift, size)
            print(f"{name}: {100 * tested['covered']:.1f} % of the intervals hold {100 * tested['share']:.2f} %")
    return write_result("stated_yields", size, content, {}, folder)


def designed(scene: Scene, size: str) -> Lift:
    """The cam of a job."""
    with TemporaryDirectory() as place:
        return optimize(scene, accuracy=ACCURACY[size], gradient="none", out=Path(place) / "run", compare=False).lift


def judged(scene: Scene, lift: Lift, size: str) -> dict:
    """The job's statement, and the verdicts of independent methods on its first trains at their worst speeds.

    A verdict differs if they confirm a train that breaks a limit, or find a broken limit in one that keeps all;
    verdicts of sensitive or not converged are open.
    """
    stated = statement_of_run(scene, lift, {"accuracy": ACCURACY[size], "speeds": "band", "seed": 0}, None)
    assert stated is not None, "the scenes say how trains differ"
    drawn = trains_as_built(scene, JUDGED[size])
    entries = [by_independent_methods(one, lift, stated.used, t) for t, one in enumerate(drawn)]
    decided = [entry for entry in entries if entry["verdict"] in ("confirmed", "rejected")]
    wrong = [entry for entry in decided if (entry["verdict"] == "confirmed") != (entry["used"] <= 1.0)]
    return {
        "share": stated.share.share,
        "low": stated.share.low,
        "high": stated.share.high,
        "trains": stated.share.trains,
        "judged": len(drawn),
        "holding": sum(entry["used"] <= 1.0 for entry in entries),
        "open": len(drawn) - len(decided),
        "differs": len(wrong),
        "entries": entries,
    }


def coverage(scene: Scene, lift: Lift, size: str) -> dict:
    """Share of simulated statements whose interval contains the yield of the sampled population."""
    effort, population = ACCURACIES[ACCURACY[size]], POPULATION[size]
    way = track(scene, lift, np.linspace(*scene.required_operation.band_rpm, effort.stated_speeds))
    holds = way.used(trains_as_built(scene, population, seed=POPULATION_SEED)).max(axis=(1, 2)) <= 1.0
    looks, random, inside = looks_of(effort, scene, None), np.random.default_rng(0), 0
    for _ in range(REPETITIONS):
        drawn = random.choice(holds, looks.trains[-1])
        ended = next(drawn[:n] for n in looks.trains if looks.ends(int(drawn[:n].sum()), n))
        stated = share_of(ended, looks)
        inside += bool(stated.low <= holds.mean() <= stated.high)
    return {
        "population": population,
        "share": float(holds.mean()),
        "covered": inside / REPETITIONS,
        "expected": looks.coverage(float(holds.mean())),
    }


if __name__ == "__main__":
    run_script(main, __doc__)
