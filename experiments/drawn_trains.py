"""What do the settled metrics of 1000 randomly varied trains of `kodama` cost, and does the compiled driver agree with
the slow path?

The trains are `kodama` with masses, stiffnesses, dampings and preloads scattered by 2 % each, at 11 speeds of the band.
The cams are one that keeps contact on the nominal train, and, with a tenth of the trains, the plain `polydyne`, which
bounces from 6000 r/min on. The fast path is `camopt.exact.settled`, started from the states of the nominal train. The
slow path settles event-exact from rest, samples the motion and takes the metrics from cubics between the samples. Times
are processor times of all threads, without compilation.
"""

import time

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.free import free_cam
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.exact.settled import ERRORS, settled_metrics
from camopt.measure.settling import settled_from_rest
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.scene import Scene, build_train, load_scene
from camopt.scene.settled import SettledMetrics
from camopt.scene.train import Train
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, run_script, write_result
from experiments.table5_conclusion import PERTURBED, perturbed

SCATTER = 0.02
TRAINS = {"small": 20, "full": 1000}
COMPARED = {"small": 2, "full": 100}
SPEEDS = {"small": 3, "full": 11}
MARGIN_N = 60.0
POLYDYNE_SHARE = 10
EVERY = 5
"""Interval, in speeds of the band, at which the paths are compared."""


def drawn_trains(train: Train, count: int) -> list[Train]:
    """Trains whose masses, stiffnesses, dampings and preloads are scattered independently."""
    rng = np.random.default_rng(0)
    return [perturbed(train, rng, (*PERTURBED, "preload"), SCATTER) for _ in range(count)]


def held(scene: Scene, speeds_rpm: np.ndarray) -> Lift:
    """A cam with a margin of contact force at every speed of the band."""
    cam, cam_speeds = free_cam(scene.design, 6.0), [scene.cam_speed(s) for s in speeds_rpm]
    return no_jump_program(build_train(scene), scene.design, cam, cam_speeds).solve(MARGIN_N).lift


def measured(trains: list[Train], nominal: Train, lift: Lift, cam_speeds: list[float]) -> tuple[dict, SettledMetrics]:
    """Cost of the fast path over the drawn trains."""
    starts = settled_metrics([nominal], [lift], cam_speeds).states  # compiles too
    begin = time.process_time()
    fast = settled_metrics(trains, [lift], cam_speeds, starts=starts)
    seconds, count = time.process_time() - begin, fast.periodic.size
    return {
        "motions": count,
        "seconds": seconds,
        "ms_per_motion": 1e3 * seconds / count,
        "periodic": int(fast.periodic.sum()),
        "refused": int(fast.refused.sum()),
        "revolutions_per_motion": float(fast.revolutions.mean()),
    }, fast


def compared(trains: list[Train], lift: Lift, cam_speeds: list[float], fast: SettledMetrics) -> dict:
    """Largest differences between the two paths in the metrics of the first trains, at every fifth speed.

    A contact that opens may amplify the last micrometre of a settled state, so such motions are counted separately.
    """
    begin, speeds = time.process_time(), cam_speeds[::EVERY]
    slow = [[_slow(train, lift, speed) for speed in speeds] for train in trains]
    seconds = time.process_time() - begin
    fast_periodic = fast.periodic[: len(trains), 0, ::EVERY]
    periodic = np.array([[one["periodic"] for one in row] for row in slow], dtype=bool)
    parts = np.array([[one["jump_mm"] > 0.0 or one["bounce_mm"] > 0.0 for one in row] for row in slow])
    difference = {}
    for name in ERRORS:
        slow_values = np.array([[one[name] for one in row] for row in slow])
        difference[name] = np.abs(slow_values - fast.worst(name)[: len(trains), 0, ::EVERY])
    kept, parted = fast_periodic & periodic & ~parts, fast_periodic & periodic & parts
    return {
        "slow_ms_per_motion": 1e3 * seconds / periodic.size,
        "compared": periodic.size,
        "periodic_in_one_only": int((periodic != fast_periodic).sum()),
        "contacts_keep": int(kept.sum()),
        "largest_difference": {name: float(d[kept].max(initial=0.0)) for name, d in difference.items()},
        "within_stated_error": all(bool(np.all(difference[n][kept] <= ERRORS[n])) for n in ERRORS),
        "contacts_part": int(parted.sum()),
        "largest_difference_where_they_part": {n: float(d[parted].max(initial=0.0)) for n, d in difference.items()},
    }


def _slow(train: Train, lift: Lift, cam_speed: float) -> dict:
    settled = settled_from_rest(prepare, train, lift, cam_speed)
    figures = settled.metrics(lift)
    return {"periodic": settled.periodic, **{name: figures.worst(name) for name in ERRORS}}


def figure(speeds_rpm: np.ndarray, by_cam: dict[str, SettledMetrics]) -> Figure:
    """Bounce of the drawn trains against speed: median, and the range of 90 % of them."""
    curves = []
    for name, metrics in by_cam.items():
        low, middle, high = np.nanpercentile(metrics.worst("bounce_mm")[:, 0], (5, 50, 95), axis=0)
        curves.append((f"{name}, median", speeds_rpm, middle))
        curves += [(f"{name}, 5 and 95 %", speeds_rpm, end) for end in (low, high)]
    title = f"{100 * SCATTER:g} % scatter: median and 90 % range"
    return panels([[Panel("bounce [mm]", curves, title)]], "engine speed [r/min]", row_height=3.0)


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `drawn_trains.json` and its figure."""
    scene = load_scene("kodama")
    speeds = np.linspace(*scene.required_operation.band_rpm, SPEEDS[size])
    cam_speeds, train = [scene.cam_speed(s) for s in speeds], build_train(scene)
    cams = {"held": held(scene, speeds), "polydyne": polydyne(scene)}
    content: dict = {"trains": TRAINS[size], "speeds_rpm": speeds.tolist(), "cams": {}, "stated_error": ERRORS}
    fast = {}
    for name, lift in cams.items():
        share = 1 if name == "held" else POLYDYNE_SHARE
        trains = drawn_trains(train, TRAINS[size] // share)
        row, fast[name] = measured(trains, train, lift, cam_speeds)
        row |= compared(trains[: max(1, COMPARED[size] // share)], lift, cam_speeds, fast[name])
        content["cams"][name] = row
        print(name, row)
    return write_result("drawn_trains", size, content, {"bounce": figure(speeds, fast)}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
