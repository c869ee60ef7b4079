"""Settled metrics of many trains, cams and speeds, each in one compiled path.

Every motion is simulated revolution by revolution until it has settled (`camopt.scene.settled`), and then measured, as
in `camopt.measure.settling` for sampled motions, but without Python between the revolutions. There are four
differences, all within `ERRORS`: the lift is compressed to few pieces; metrics are evaluated at located extremes
instead of those of cubics through samples; if the slowest mode needs more than 40 revolutions, these are simulated
instead of a direct search for the periodic motion; and a periodic motion of which few revolutions are measured is
simulated up to the next opening foot instead of a whole further revolution.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.adjoint.metrics import METRICS
from camopt.exact.adjoint.motion import metric_numbers
from camopt.exact.affine.inputs import Inputs
from camopt.exact.affine.lines import rest_of
from camopt.exact.engine import AT_ONCE, free_step
from camopt.exact.kernel.arrays import CamArrays
from camopt.exact.kernel.propagators import Lending, propagators
from camopt.exact.kernel.revolution import DONE, Setting
from camopt.exact.settled import run as stages
from camopt.exact.settled.figures import NAMES
from camopt.exact.settled.lift_pieces import WIDTH, compress_lift
from camopt.scene import settled
from camopt.scene.settled import SettledMetrics
from camopt.scene.train import Forcing, Train
from camopt.scene.vibration import slowest_rate

ERRORS = {
    "bounce_mm": 1e-3,
    "jump_mm": 1e-3,
    "jump_deg": 0.02,
    "contact_force_min_N": 1.0,
    "contact_force_max_N": 1.0,
    "seating_velocity_m_per_s": 1e-3,
    "impact_velocity_m_per_s": 1e-3,
    "dynamic_area_mm_deg": 0.01,
    "excess_lift_mm": 1e-3,
}
"""Largest difference of every metric, in its unit, from the path on sampled motions for a periodic motion whose
contacts stay closed: about the effect of the tolerances of settling, a micrometre and a millimetre per second. If
contacts separate, the difference is a multiple of it (`experiments/drawn_trains.py`)."""
PARTS = 4
"""Number of parts per thread into which the motions of one train are divided."""


def settled_metrics(
    trains: Sequence[Train],
    lifts: Sequence[Lift],
    cam_speeds: Sequence[float],
    *,
    starts: np.ndarray | None = None,
    decay: float | None = None,
    most: int = settled.PLAIN_REVOLUTIONS,
    measured: int = settled.MEASURED,
    aperiodic: int = settled.APERIODIC,
    tolerance: float = 1.0,
    workers: int = 2,
    kept: bool = True,
) -> SettledMetrics:
    """Every declared metric of the settled motion of each train with each cam at each speed [rad/s].

    The states of all trains must have the same size. `starts`, of a shape that broadcasts to (t, c, s, 2n + r), are the
    states at -pi from which the motions begin, [m], [m/s], [m]; without them they begin at rest. `decay` is the number
    of e-folds by which perturbations decay over a revolution, infinite for a train without slow modes; by default it
    follows from each train's slowest mode or leak. A motion without slow modes has at most `most` revolutions to
    settle, and more only while its changes are within the tolerances, which are multiplied by `tolerance`.

    Then `measured` revolutions of a periodic motion are measured, and at least `aperiodic` ones of another. At least
    MEASURED revolutions are needed to confirm that a motion settles (`camopt.scene.settled`); with fewer, the last
    change decides. The range of an aperiodic motion is reliable from RANGED revolutions on.

    `workers` threads share the work. The propagators of a single train are `kept` for its next motions. Raises
    InputError for a train without valve, seat or contact between cam and valve.
    """
    for train in trains:
        metric_numbers(train, METRICS)  # raises InputError for an unsuitable train
    speeds = np.asarray(cam_speeds, dtype=float)
    cams = {forcing: _cams(lifts, forcing) for forcing in {train.forcing for train in trains}}
    metrics = _empty_metrics(len(trains), len(lifts), speeds, trains[0].state_size)
    metrics.states[:] = np.array([rest_of(train) for train in trains])[:, None, None] if starts is None else starts
    units = tolerance * settled.SETTLED_POSITION, tolerance * settled.SETTLED_VELOCITY
    plan = stages.Plan(*units, measured, aperiodic, settled.APERIODIC, measured >= settled.MEASURED)
    tables_of = propagators if kept and len(trains) == 1 else Lending
    parts = 1 if len(trains) >= workers else PARTS * workers

    def jobs() -> Iterator[Job]:
        for t, train in enumerate(trains):
            yield from _jobs(t, train, metrics.states[t], speeds, (decay, most), (tables_of, parts))

    def run_job(job: Job) -> None:
        _run(job, cams[trains[job.t].forcing], plan)
        job.write(metrics)

    with ThreadPoolExecutor(workers) as pool:  # it starts no thread if it is not used
        list((map if workers == 1 else pool.map)(run_job, jobs()))
    return metrics


class Job(NamedTuple):
    """Motions (m) of train number t that use one set of tables, with the numbers of their cams and speeds."""

    t: int
    tables: Lending
    cam: np.ndarray
    speed: np.ndarray
    motions: stages.SettlingMotions

    def write(self, metrics: SettledMetrics) -> None:
        """Write the results of these motions to their places in `metrics`."""
        at, m = (self.t, self.cam, self.speed), self.motions
        for i, name in enumerate(NAMES):
            metrics.lowest[name][at], metrics.highest[name][at] = m.lowest[:, i], m.highest[:, i]
        metrics.periodic[at], metrics.refused[at] = m.stage == stages.PERIODIC, m.stage == stages.REFUSED
        metrics.revolutions[at], metrics.states[at] = m.revolutions, m.state


def _empty_metrics(t: int, c: int, speeds: np.ndarray, width: int) -> SettledMetrics:
    """Metrics of t trains and c cams, not yet filled; `width` is the size of a state."""
    shape = t, c, len(speeds)
    low, high = ({name: np.empty(shape) for name in NAMES} for _ in range(2))
    flags = np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape, int)
    return SettledMetrics(speeds, low, high, *flags, np.empty((*shape, width)), ERRORS)


def _cams(lifts: Sequence[Lift], forcing: tuple[Forcing, ...]) -> stages.Cams:
    """The concatenated pieces of all cams, with compressed lift and the forces over the cam angle."""
    compressed = [compress_lift(lift) for lift in lifts]
    inputs = [Inputs(forcing, borders) for borders, _ in compressed]
    pieces = [cut.pieces(coefficients) for cut, (_, coefficients) in zip(inputs, compressed, strict=True)]
    return stages.Cams(
        np.concatenate([cut.borders for cut in inputs]),
        np.concatenate(pieces),
        np.cumsum([0, *(len(rows) for rows in pieces)]),
        np.array([lift.half_duration for lift in lifts]),
        np.array([lift.opening_foot for lift in lifts]),
    )


def _jobs(
    t: int, train: Train, starts: np.ndarray, speeds: np.ndarray, settling: tuple[float | None, int], cut: tuple
) -> Iterator[Job]:
    """The motions of train number t from their starts (c, s, 2n + r), grouped by common tables.

    `settling` is (decay, most); `cut` is (constructor of the tables, approximate number of parts of each group).
    """
    (decay, most), (tables_of, parts) = settling, cut
    steps = np.array([free_step(train, speed) for speed in speeds])
    decays = np.full(len(speeds), decay) if decay is not None else slowest_rate(train) * 2 * np.pi / speeds
    remaining, needed = (np.array([f(d) for d in decays]) for f in (settled.way_left, settled.revolutions_needed))
    longest = np.where(needed > settled.PLAIN_REVOLUTIONS, np.minimum(needed, settled.MOST_REVOLUTIONS), most)
    cam, speed = np.indices(starts.shape[:2]).reshape(2, -1)
    for step in np.unique(steps):
        tables, same_step = tables_of(train, float(step), WIDTH, AT_ONCE), np.flatnonzero(steps[speed] == step)
        for chosen in (same_step[i::parts] for i in range(min(parts, len(same_step)))):
            c, s = cam[chosen], speed[chosen]
            motions = stages.SettlingMotions(
                cam=c,
                speed=speeds[s],
                remaining=remaining[s],
                most=longest[s],
                state=starts[c, s],
                stage=np.full(len(chosen), stages.SETTLING),
                revolutions=np.zeros(len(chosen), dtype=np.int64),
                within=np.zeros(len(chosen), dtype=np.int64),
                apart=np.zeros((len(chosen), 3)),
                turns=np.zeros(len(chosen), dtype=np.int64),
                lowest=np.empty((len(chosen), len(NAMES))),
                highest=np.empty((len(chosen), len(NAMES))),
            )
            yield Job(t, tables, c, s, motions)


def _run(job: Job, cams: stages.Cams, plan: stages.Plan) -> None:
    """Simulate all motions of a job, enlarging the tables and the trace when they are full."""
    cam, i = CamArrays(cams.borders, cams.pieces, 0.0), 0
    with job.tables.lent() as lent:
        while i < len(job.cam):
            setting = Setting(lent.arrays, cam, lent.step, lent.tables, 0.0, 0.0)
            trace = lent.trace(settled.APERIODIC + 1)
            i, code = stages.run(setting, plan, cams, job.motions, trace, i)
            if code != DONE:
                lent.grow(code)
