"""The gradient stage: sequential linear steps on the free coefficients along the metrics' slopes, judged non-smoothly.

At the best confirmed cam the contacts barely part, and there gradients lead on. Each step
solves the design's linear program once more: all limits on the shape exactly, every limited metric linearised at the
speeds where it is used most, and a trust region in newtons: no contact force of the linear model falls further than
that below what it is. A step counts only if the event-exact judge confirms it; if not, the region shrinks. The stage
ends where the linear model itself promises less area than the search resolves.
"""

from dataclasses import dataclass, replace

import numpy as np

from camopt.highs import Infeasible
from camopt.optimizer.program.force_rows import PEAK, SEAT
from camopt.optimizer.program.kinematic import area_ratio_row, reach, spline_rows
from camopt.optimizer.program.no_jump import NoJumpOptimum, NoJumpProgram
from camopt.optimizer.search.judge import USABLE_SHARE, Judged
from camopt.optimizer.search.margins import margin_stage
from camopt.optimizer.search.no_jump_stage import RESOLUTION, Search
from camopt.optimizer.search.sensitivity import ExactSensitivity, Sensitivity

ON_MARGINS = 0.25
"""Part of the steps that Adam takes on the margins, before the free steps."""
WIDTH = 8
"""Speeds whose metrics are linearised in a step: those that use their limits most."""
FIRST_TRUST_N, LEAST_TRUST_N = 40.0, 0.25
"""Trust region at the start, and where the stage ends."""
TRUST_BY_KIND = np.array([1.0, 0.2, 1.0])
"""Part of the trust region that opening flank, closing flank and seat forces may use: a contact that parts on the
closing flank lands on the ramp and the seat, where metrics are far from linear; tension on opening costs little."""
GROWTH, SHRINKAGE = 1.5, 0.4
AIM = USABLE_SHARE - 0.03
"""Share of its limit that a linearised metric may use."""
MOST_SHARE = 4.0
"""A larger share says only that a step went far too far."""


def gradient_stage(search: Search, program: NoJumpProgram, steps: int) -> str:
    """Improve `search.best` by at most `steps` steps within the speeds and angles of `program`: margins, then z.

    The slopes of the metrics are those of event-exact. Returns a sentence on where it ended.
    """
    assert search.best is not None and search.best_judged is not None, "the no-jump stage comes first"
    sensitivity = ExactSensitivity(search.judge.scene, program.cam, search.best_judged.limited, WIDTH)
    on_margins = int(ON_MARGINS * steps)
    ended = (
        margin_stage(search, program, sensitivity, on_margins),
        free_stage(search, program, sensitivity, steps - on_margins),
    )
    return f"The gradient stage (exact) ended {ended[0]}, then {ended[1]}."


def free_stage(search: Search, program: NoJumpProgram, sensitivity: Sensitivity, steps: int) -> str:
    """Improve `search.best` by at most `steps` steps on z; returns why it ended."""
    trust, best = FIRST_TRUST_N, search.best
    assert best is not None and search.best_judged is not None, "the no-jump stage comes first"
    model = linearised(best.z, search.best_judged, sensitivity)
    for taken in range(steps):
        try:
            found = step(program, best, model, trust)
        except Infeasible:
            trust *= SHRINKAGE
            model = replace(model, curvature=model.curvature * SHRINKAGE**2)
            continue
        promised = found.area_ratio - best.area_ratio
        if promised < RESOLUTION:
            return (
                f"after {taken} of {steps} free steps, where the model promised {max(promised, 0.0):.2g} of area ratio"
            )
        judged = search.consider("gradient", found)
        if search.best is best:
            model = model.corrected(found.z, judged)
            trust *= SHRINKAGE
        else:
            trust, best = trust * GROWTH, found
            model = linearised(best.z, judged, sensitivity)
        if trust < LEAST_TRUST_N:
            return f"after {taken + 1} of {steps} free steps, as its trust region vanished"
    return f"after all {steps} free steps"


@dataclass(frozen=True)
class Linearised:
    """Shares of limits about z0, to first order: share + slope @ (z - z0) + curvature <= AIM, rows (r)."""

    z0: np.ndarray
    metric: np.ndarray  # (r) index into the judged metrics
    speed_rpm: np.ndarray  # (r)
    share: np.ndarray  # (r) at z0, judged
    slope: np.ndarray  # (r, m)
    curvature: np.ndarray  # (r) what the last refused step used beyond the first order

    def corrected(self, z: np.ndarray, judged: Judged) -> "Linearised":
        """This model with what a refused step showed beyond the first order, scaled to the smaller next step."""
        expected = self.share + self.slope @ (z - self.z0)
        at = np.minimum(np.searchsorted(judged.speeds_rpm, self.speed_rpm), len(judged.speeds_rpm) - 1)
        shown = np.minimum(judged.share[self.metric, at], MOST_SHARE)
        known = judged.speeds_rpm[at] == self.speed_rpm  # a cam that fails early is not judged everywhere
        return replace(self, curvature=SHRINKAGE**2 * np.where(known, np.maximum(shown - expected, 0.0), 0.0))

    def bound(self) -> np.ndarray:
        """Right side of slope @ z <= bound (r); a share above AIM may stay but not grow."""
        return np.maximum(AIM - self.curvature - self.share, 0.0) + self.slope @ self.z0


def linearised(z: np.ndarray, judged: Judged, sensitivity: Sensitivity) -> Linearised:
    """The judge's shares with the path's slopes, at the speeds that use a limit most.

    A metric without slope (the bounce of a valve that does not bounce) gives no row.
    """
    usable = np.all(np.isfinite(judged.states), axis=1)
    order = np.argsort(-np.where(usable, judged.share.max(axis=0), -1.0))[:WIDTH]
    _, slopes = sensitivity(z, judged, order)
    slopes = slopes * judged.share_slopes[:, None]  # (r, l, m)
    known = np.all(np.isfinite(slopes), axis=2) & np.any(slopes != 0, axis=2)
    at, metric = np.nonzero(known)
    share = judged.share[metric, order[at]]
    return Linearised(z, metric, judged.speeds_rpm[order[at]], share, slopes[at, metric], np.zeros(len(at)))


def step(program: NoJumpProgram, best: NoJumpOptimum, model: Linearised, trust: float) -> NoJumpOptimum:
    """The cam of largest area about `best` under the linearised metrics; raises Infeasible where there is none."""
    forces = program.forces(best.z)
    least = np.full((3, len(program.blocks)), np.inf)
    pushes = program.kind != PEAK
    np.minimum.at(least, (np.minimum(program.kind, SEAT)[pushes], program.speed[pushes]), forces[pushes])
    least = np.where(np.isfinite(least), least, 0.0) - trust * TRUST_BY_KIND[:, None]
    matrix = np.concatenate([program.rows.matrix, model.slope])
    bound = np.concatenate([program.bound(least), model.bound()])
    row, constant = area_ratio_row(program.design, program.cam)
    begin = np.concatenate([best.optimum.working, np.arange(len(program.rows.norm), len(bound))])
    begin = begin[begin < len(bound)]
    optimum = reach(program.cam, program.design, row, spline_rows(matrix), bound, begin)
    return NoJumpOptimum(program, least, optimum.z, optimum.value + constant, optimum)
