"""Cams around the limits for `near_limit`: they keep the limits on the shape, and their worst metric is half to twice a
limit.

Each cam lies on a line of free cams from one that keeps contact with a margin to one that is designed with a negative
margin of force, or to the largest cam under the limits on the shape. These limits are convex, so every cam between two
admissible ones is admissible. The position on the line is found by bisection of the reference: the event-exact settled
motion at every r/min of a band.

A surge mode with 0.05 % damping takes hundreds of revolutions to settle, so the settled state is computed as the fixed
point of the cycle map: from the states at neighbouring speeds, by Newton's method with a Jacobian that is kept from
speed to speed and computed again when convergence is slow. A fixed point is accepted if the spectral radius of the
Jacobian is below one; otherwise the motion settles by plain revolutions, with a tolerance a hundred times smaller than
that of the verdict. The motion from rest, by plain revolutions, is computed at a sample of the speeds.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.lift import Lift
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.engine import prepare
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.scene import MotionRefused, Scene, build_train
from camopt.scene.rest import state_at_rest
from camopt.scene.train import Train

METRICS = ("bounce_mm", "jump_mm", "seating_velocity_m_per_s")
UNIT = 1e-6, 1e-3
"""Units of position [m] and velocity [m/s]: the tolerances within which the verdict counts a motion as settled."""
SETTLED, ACCURACY = 1e-2, 1e-4
"""Change over a revolution, in UNIT, of a state that settled plainly and of a fixed point."""
DIFFERENCE = 1e-2
MOST_NEWTON, OLDEST = 8, 10
"""Largest number of Newton steps, and of speeds until Jacobian and stability are computed again."""
LARGEST_RADIUS = 1 - 1e-4
WAIT = 4
"""Number of speeds that settle by plain revolutions after one at which no fixed point was found."""
MOST = 150
"""Revolutions within which a motion must settle; an aperiodic one is then measured over MEASURED more."""
MEASURED = 4
COLD = 3
"""Number of speeds at which the motion from rest is computed too: the worst one and others."""


@dataclass(frozen=True)
class Truth:
    """Metrics (speeds, metrics) of a cam over a band, and whether the motion is periodic at each speed."""

    speeds_rpm: np.ndarray
    figures: np.ndarray
    periodic: np.ndarray
    limits: np.ndarray  # (metrics), in the units of METRICS

    @property
    def shares(self) -> np.ndarray:
        """Largest ratio of a metric to its limit at each speed; infinite where the valve does not seat."""
        return np.nan_to_num(np.max(self.figures / self.limits, axis=1), nan=np.inf)

    @property
    def share(self) -> float:
        """The largest ratio over the band; above one a limit is broken."""
        return float(np.max(self.shares))

    def as_row(self) -> dict:
        """The entries of the results table."""
        at = int(np.argmax(self.shares))
        which = int(np.argmax(np.nan_to_num(self.figures[at] / self.limits, nan=np.inf)))
        return {
            "share": self.share,
            "metric": METRICS[which],
            "speed_rpm": float(self.speeds_rpm[at]),
            **{name: float(np.max(column)) for name, column in zip(METRICS, self.figures.T, strict=True)},
            "speeds_over": int(np.sum(self.shares > 1.0)),
            "aperiodic": int(np.sum(~self.periodic)),
        }


def limits_of(scene: Scene) -> np.ndarray:
    """The limits of a scene on METRICS."""
    design = scene.design
    return np.array([design.bounce_max_mm, design.jump_max_mm, design.seating_velocity_max_m_per_s])


def truth(scene: Scene, lift: Lift, speeds_rpm: np.ndarray, enough: float = np.inf, most: int = MOST) -> Truth:
    """The settled motion at ascending speeds, each from its neighbours'; ends where a limit ratio exceeds `enough`.

    Where no fixed point is found, at most `most` plain revolutions are computed.
    """
    train, limits = build_train(scene), limits_of(scene)
    fixed, figures, periodic = FixedPoints(train, most), [], []
    for speed in speeds_rpm:
        try:
            metrics, repeats = fixed.next(lift, scene.cam_speed(speed))
        except MotionRefused:
            metrics, repeats = np.full(len(METRICS), np.nan), False
        figures.append(metrics)
        periodic.append(repeats)
        if np.max(np.nan_to_num(metrics / limits, nan=np.inf)) > enough:
            break
    return Truth(speeds_rpm[: len(figures)], np.array(figures), np.array(periodic), limits)


class FixedPoints:
    """Settled states of a train at consecutive speeds."""

    def __init__(self, train: Train, most: int):
        self.train, self.scale, self.most = train, np.repeat(UNIT, len(train.mass)), most
        self.states: list[np.ndarray] = []  # of the last speeds with a periodic motion, in UNIT
        self.slope: np.ndarray | None = None  # Jacobian of the cycle map, in UNIT
        self.age = 0
        self.waits = 0  # speeds without Newton's method, because it failed shortly before

    def next(self, lift: Lift, cam_speed: float) -> tuple[np.ndarray, bool]:
        """(worst METRICS of the settled motion, whether it is periodic) at the next speed."""
        revolve = prepare(self.train, lift, cam_speed)

        def cycle(y: np.ndarray) -> np.ndarray:
            return revolve.advance(y * self.scale) / self.scale

        y = self._newton(cycle) if self.states and self.waits == 0 else None
        self.waits = max(0, self.waits - 1)
        repeats = y is not None
        if y is None:
            start = self.states[-1] if self.states else state_at_rest(self.train) / self.scale
            self.waits = self.waits or (WAIT if self.states else 0)
            y, repeats = settled(cycle, start, self.most)
            self.states, self.slope = [], None
        self.states = [*self.states[-1:], y]
        return worst(self.train, lift, cam_speed, y * self.scale, 1 if repeats else MEASURED), repeats

    def _newton(self, cycle) -> np.ndarray | None:
        """A stable fixed point near the last ones, or None."""
        y = self.states[-1] if len(self.states) < 2 else 2 * self.states[-1] - self.states[-2]
        change, fresh = cycle(y) - y, False
        self.age += 1
        for _ in range(MOST_NEWTON):
            if np.abs(change).max() < ACCURACY and self.slope is not None and self.age <= OLDEST:
                return y
            if self.slope is None or self.age > OLDEST:
                self.slope, self.age, fresh = jacobian(cycle, y, change + y), 0, True
                if np.abs(np.linalg.eigvals(self.slope)).max() >= LARGEST_RADIUS:
                    return None
            new = y - np.linalg.solve(self.slope - np.eye(len(y)), change)
            left = cycle(new) - new
            if np.abs(left).max() > 0.5 * np.abs(change).max():
                if fresh:
                    return None
                self.slope = None
            if np.abs(left).max() < np.abs(change).max():
                y, change, fresh = new, left, False
        return None


def jacobian(cycle, y: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Forward differences of the cycle map about y, whose image is `after`, all in UNIT."""
    return np.stack([(cycle(y + DIFFERENCE * unit) - after) / DIFFERENCE for unit in np.eye(len(y))], axis=1)


def settled(cycle, y: np.ndarray, most: int) -> tuple[np.ndarray, bool]:
    """(state after plain revolutions, whether it has settled to SETTLED), in UNIT."""
    for _ in range(most):
        after = cycle(y)
        change, y = np.abs(after - y).max(), after
        if change < SETTLED:
            return y, True
    return y, False


def from_rest(scene: Scene, lift: Lift, speeds_rpm) -> Truth:
    """The settled motion at speeds that are each started at rest, by plain revolutions."""
    parts = [truth(scene, lift, np.array([speed])) for speed in speeds_rpm]
    figures, periodic = (np.concatenate([getattr(p, name) for p in parts]) for name in ("figures", "periodic"))
    return Truth(np.asarray(speeds_rpm, dtype=float), figures, periodic, limits_of(scene))


def worst(train: Train, lift: Lift, cam_speed: float, state: np.ndarray, measured: int) -> np.ndarray:
    """The largest METRICS of `measured` revolutions from a state (2n), at the instants of event-exact's own steps."""
    motion = TracedMotion(train, lift, cam_speed, state, measured + 1)
    return np.max([motion.values(METRICS, revolution) for revolution in range(measured)], axis=0)


KNOTS_DEG = 3.0, 4.0, 5.0
AROUND = 0.5, 2.0
"""Range of the largest ratio of a metric to its limit."""
KEPT_N, TENSION_N = (0.0, 80.0), (20.0, 800.0)
"""Ranges of the margins [N] at the safe end of a line and of the negative ones at the other, by flank and seat."""
KINEMATIC = 0.4
"""Share of the lines that end at the largest cam under the limits on the shape."""
PROGRAM_SPEEDS = 4
COARSE_RPM, COARSE_MOST = 12.0, 40
"""Step of the speeds in the first bisection [r/min], and largest number of plain revolutions at each."""
BISECTIONS, FULL = 7, 5
PER_LINE = 4
DIGITS = 12
"""Digits to which a cam's coefficients are rounded before any use, so that its record is exact."""


@dataclass(frozen=True)
class NearLimit:
    """A random cam: free coefficients z (m) on the knots of `knot_deg`, and its reference motion over the band."""

    knot_deg: float
    z: np.ndarray
    truth: Truth


def lift_of(scene: Scene, knot_deg: float, z) -> Lift:
    """The lift law of a random cam."""
    return free_cam(scene.design, knot_deg).lift(np.asarray(z))


def near_limit_cams(scene: Scene, rng: np.random.Generator, most: int = PER_LINE) -> list[NearLimit]:
    """Up to `most` different cams of one random line whose worst metric at any r/min lies around its limit."""
    knot_deg = float(rng.choice(KNOTS_DEG))
    cam = free_cam(scene.design, knot_deg)
    safe, risky = _line(scene, cam, rng)
    targets = np.exp(rng.uniform(*np.log(AROUND), PER_LINE))[:most]
    located = [_located(scene, cam, safe, risky, target) for target in targets]
    cams = [NearLimit(knot_deg, *cam) for cam in located if cam is not None]
    return list({cam.z.tobytes(): cam for cam in cams}.values())


def band(scene: Scene, step: float = 1.0) -> np.ndarray:
    """The speeds of a scene's band [r/min], its upper end included."""
    low, high = scene.operation.band_rpm
    return np.unique(np.append(np.arange(low, high, step), high))


def _line(scene: Scene, cam: FreeCam, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the safe and of the risky end of a line."""
    design = scene.design
    speeds = [scene.cam_speed(s) for s in np.linspace(*scene.operation.band_rpm, PROGRAM_SPEEDS)]
    program = no_jump_program(build_train(scene), design, cam, speeds)
    margins, tension = rng.uniform(*KEPT_N, 3), np.exp(rng.uniform(*np.log(TENSION_N), 3))
    try:
        safe = program.solve(margins).z
    except NoCamHoldsContact as none:
        safe = program.solve(margins - none.shortfall_N - 1.0).z
    if rng.random() < KINEMATIC:
        return safe, kinematic_optimum(design, cam).z
    return safe, program.solve(-tension).z


def _located(scene: Scene, cam: FreeCam, safe, risky, target: float) -> tuple[np.ndarray, Truth] | None:
    """The cam of the line whose largest ratio is the target at COARSE_RPM, and within AROUND at every r/min."""

    def at(s: float) -> np.ndarray:
        return np.array([float(f"{value:.{DIGITS}g}") for value in safe + s * (risky - safe)])

    def share(s: float, step: float) -> tuple[float, Truth]:
        most = MOST if step == 1.0 else COARSE_MOST
        motion = truth(scene, cam.lift(at(s)), band(scene, step), enough=AROUND[1], most=most)
        return motion.share, motion

    low, high = 0.0, 1.0
    if share(low, COARSE_RPM)[0] > AROUND[1] or share(high, COARSE_RPM)[0] < AROUND[0]:
        return None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        value = share(middle, COARSE_RPM)[0]
        low, high = (low, middle) if value > target else (middle, high)
    s, width = 0.5 * (low + high), 0.125
    for _ in range(FULL):
        value, motion = share(s, 1.0)
        if AROUND[0] <= value <= AROUND[1]:
            return at(s), motion
        s = float(np.clip(s + (width if value < AROUND[0] else -width) * s, 0.0, 1.0))
        width *= 0.6
    return None
