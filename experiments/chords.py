"""What error in force and motion do chords of a curved force law leave, what do they cost, and what do force tables
cost a linear train?

Event-exact replaces every Hertz contact and every progressive spring by N chords. For each N the result has: the
largest error of the force, with the predicted one (for a Hertz contact F / (6 N^2)); the differences of the metrics of
a settled motion from those with twice the finest N; the relative error of gradients by bumps on the cam, compared with
central differences of DOP853, which uses the law itself; and the time of a revolution. Then `kodama` is compared with a
copy whose springs are tables of one straight line: the time of a revolution, sampled and not, and of a gradient,
measured in turn in one run.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare, settled_metrics, with_chords
from camopt.exact.adjoint.motion import TracedMotion, value_and_gradient
from camopt.exact.affine.lines import CHORD_FORCE, chords_per_row
from camopt.scene import build_train, load_scene
from camopt.scene.laws import CURVED, HERTZ, LINEAR, OF_CONTACTS, PROGRESSIVE, TABLE, Laws
from camopt.scene.rest import state_at_rest
from camopt.scene.train import Train
from camopt.study.gradient.paths import METRICS, REVOLUTIONS, Problem, problem
from camopt.study.gradient.report import central_differences
from camopt.study.measurements import fastest
from experiments.support.record import RESULTS, run_script, write_result

MOTIONS = {"kodama-hertz": 5500.0, "race-nested": 6000.0}
"""Crankshaft speeds [r/min] of the scenes with curved laws."""
CHORDS = {"small": (8, 16), "full": (8, 16, 32, 64)}
REPEATS = {"small": 3, "full": 200}
FIGURES = "contact_force_max_N", "seating_velocity_m_per_s", "jump_mm"
SLOPES = "contact_force_max_N", "seating_velocity_m_per_s", "dynamic_area_mm_deg"
BUMPS, BUMP_M = {"small": 1, "full": 2}, 1e-6
GRID = 20_001
LONG = 1e-3
"""Half the length [m] of a spring's table; the straight line continues beyond it."""
LOOKS = 101
"""Number of depths at which a chord is compared with its law; it misses at most 1e-4 of the largest error."""


def main(size: str = "full", folder=RESULTS) -> dict:
    """Errors and times against N, and the price of tables."""
    chords = {name: of_scene(name, CHORDS[size], REPEATS[size], BUMPS[size]) for name in MOTIONS}
    content = {"chords": chords, "tables_over_linear": price_of_tables(REPEATS[size])}
    return write_result("chords", size, content, {}, folder)


def of_scene(name: str, counts: tuple[int, ...], repeats: int, bumps: int) -> list[dict]:
    """A row for each number of chords."""
    scene = load_scene(name)
    train, lift, speed = build_train(scene), polydyne(scene), scene.cam_speed(MOTIONS[name])
    finest, rows = settled(with_chords(train, 2 * counts[-1]), lift, speed), []
    bumped = problem(scene, lift, MOTIONS[name], bumps)
    true = dict(zip(METRICS, central_differences(bumped, BUMP_M), strict=True))
    for count in counts:
        chorded = with_chords(train, count)
        figures, begin = settled(chorded, lift, speed), state_at_rest(chorded)
        revolve = prepare(chorded, lift, speed)
        off = {key: abs(figures[key] - finest[key]) for key in FIGURES}
        (seconds,) = least([partial(revolve.advance, begin)], repeats)
        row = {"chords": count, "force_error_N": force_error(train, chorded), "off": off}
        row["slope_off"] = {key: slope_error(replace(bumped, train=chorded), key, true[key]) for key in SLOPES}
        rows.append(row | {"predicted_N": float(chord_error(train, count).max()), "revolution_ms": 1e3 * seconds})
    return rows


def chord_error(train: Train, count: int) -> np.ndarray:
    """Largest error [N] of each element's force (e) under `count` chords, for laws of contacts up to CHORD_FORCE."""
    error, laws = np.zeros(len(train.a)), train.laws
    if laws is None:
        return error
    for e in range(len(error)):
        kind, rows = laws.kind[e], laws.table[e, : laws.rows[e]]
        if kind in OF_CONTACTS:
            law = laws.contact_law(e)
            p = CHORD_FORCE * (np.arange(count + 1) / count) ** 2
            ends = law.depth(p)
            u, chord = (np.linspace(q[:-1], q[1:], LOOKS) for q in (ends, p))
            error[e] = np.abs(law.elastic(u) - chord).max()
        elif kind == PROGRESSIVE:
            bent = np.abs(np.diff(rows[:, 1])) * np.diff(rows[:, 0]) / 8.0
            error[e] = np.max(bent / chords_per_row(rows, count) ** 2, initial=0.0)
    return error


def slope_error(bumped: Problem, metric: str, true: np.ndarray) -> float:
    """Relative distance of the exact path's gradient by bumps (m) from the central differences `true` (m)."""
    start = (bumped.train, bumped.lift, bumped.cam_speed, [metric], bumped.start)
    by_cam = value_and_gradient(*start, revolutions=REVOLUTIONS).by_coefficients[0]
    slopes = np.einsum("pq,mpq->m", by_cam, bumped.directions)
    return float(np.linalg.norm(slopes - true) / np.linalg.norm(true))


def settled(train: Train, lift: Lift, speed: float) -> dict[str, float]:
    """The worst FIGURES of the settled motion."""
    metrics = settled_metrics([train], [lift], [speed], workers=1)
    return {name: float(metrics.worst(name)[0, 0, 0]) for name in FIGURES}


def force_error(curved: Train, chorded: Train) -> float:
    """Largest difference [N] of an element's force between its law and its chords, up to CHORD_FORCE."""
    worst = 0.0
    assert curved.laws is not None and chorded.laws is not None
    for e in np.flatnonzero(np.isin(curved.laws.kind, CURVED)):
        rows = curved.laws.table[e] if curved.laws.kind[e] != HERTZ else chorded.laws.table[e]
        d = np.linspace(rows[0, 0], rows[rows[:, 0] < rows[0, 0] + 0.5, 0].max(), GRID)
        true, lines = (t.laws.along(e, d, t.preload[e])[0] for t in (curved, chorded))
        inside = np.abs(true) <= CHORD_FORCE
        worst = max(worst, float(np.abs(true - lines)[inside].max()))
    return worst


def price_of_tables(repeats: int) -> dict[str, float]:
    """Ratio of times with tables of one line to those with linear springs, for `kodama`'s Polydyne at 7000 r/min."""
    scene = load_scene("kodama")
    linear, lift, speed = build_train(scene), polydyne(scene), scene.cam_speed(7000.0)
    work: dict[str, list[Callable[[], object]]] = {"end state": [], "sampled": [], "gradient": []}
    for train in (linear, by_tables(linear)):
        revolve, start = prepare(train, lift, speed), state_at_rest(train)
        work["end state"].append(partial(revolve.advance, start))
        work["sampled"].append(partial(revolve, start))
        work["gradient"].append(partial(gradient, train, lift, speed, start))
    return {name: float(np.divide(*reversed(least(runs, repeats)))) for name, runs in work.items()}


def gradient(train: Train, lift: Lift, speed: float, start: np.ndarray):
    """Seating velocity of a revolution with its gradient by the cam."""
    return TracedMotion(train, lift, speed, start).gradient(["seating_velocity_m_per_s"])


def by_tables(train: Train) -> Train:
    """A linear train with every spring written as a table of one straight line."""
    e, none = len(train.a), np.zeros(len(train.a))
    ends = train.preload[:, None] + train.stiffness[:, None] * np.array([-LONG, LONG])
    table = np.stack([np.broadcast_to([-LONG, LONG], (e, 2)), ends], axis=2)
    kind = np.where(train.contact, LINEAR, TABLE)
    laws = Laws(kind, train.stiffness, np.ones(e), none, table, leak=none, travel=none, slip=none, rows=np.full(e, 2))
    return replace(train, laws=laws)


def least(runs: list[Callable[[], object]], repeats: int) -> list[float]:
    """Least processor times [s] of calls made in turn; the first call of each builds tables and is not counted."""
    seconds = [[fastest(run, 1, first=False)[0] for run in runs] for _ in range(repeats + 1)]
    return np.min(seconds[1:], axis=0).tolist()


if __name__ == "__main__":
    run_script(main, __doc__)
