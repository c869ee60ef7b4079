"""Cams around the limits for `near_limit`: legal in shape, and their worst figure is half to twice a limit.

Each lies on a line of free cams from one that keeps contact with a margin to one that is allowed tension, or to the
largest that the shape's limits allow; the limits on the shape are convex, so every cam between two legal ones is
legal. Where on the line, bisection of the truth says.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam
from camopt.cam.lift import Lift
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import NoCamHoldsContact, no_jump_program
from camopt.scene import Scene, build_train
from experiments.support.near_limit_truth import MOST, Truth, truth

KNOTS_DEG = 3.0, 4.0, 5.0
AROUND = 0.5, 2.0
"""Worst figure over its limit."""
KEPT_N, TENSION_N = (0.0, 80.0), (20.0, 800.0)
"""Margins of the safe end of a line, and tension of the other, drawn for each flank and the seat."""
KINEMATIC = 0.4
"""Share of the lines that end at the largest cam that the shape's limits allow."""
PROGRAM_SPEEDS = 4
COARSE_RPM, COARSE_MOST = 12.0, 40
"""Step of the speeds in a first bisection, and plain revolutions at each."""
BISECTIONS, FULL = 7, 5
PER_LINE = 4
DIGITS = 12
"""To which a cam's coefficients are rounded before anything is done with it, so that its record says all of it."""


@dataclass(frozen=True)
class NearLimit:
    """A drawn cam: free coefficients z (m) on the knots of `knot_deg`, and its truth over the band."""

    knot_deg: float
    z: np.ndarray
    truth: Truth


def lift_of(scene: Scene, knot_deg: float, z) -> Lift:
    """The lift law of a drawn cam."""
    return free_cam(scene.design, knot_deg).lift(np.asarray(z))


def near_limit_cams(scene: Scene, rng: np.random.Generator, most: int = PER_LINE) -> list[NearLimit]:
    """Up to `most` different cams of one drawn line whose worst figure at any r/min lies around its limit."""
    knot_deg = float(rng.choice(KNOTS_DEG))
    cam = free_cam(scene.design, knot_deg)
    safe, risky = _line(scene, cam, rng)
    targets = np.exp(rng.uniform(*np.log(AROUND), PER_LINE))[:most]
    found = [_located(scene, cam, safe, risky, target) for target in targets]
    different = {z.tobytes(): NearLimit(knot_deg, z, known) for z, known in (one for one in found if one is not None)}
    return list(different.values())


def band(scene: Scene, step: float = 1.0) -> np.ndarray:
    """The speeds of a scene's band [r/min], its upper end included."""
    low, high = scene.operation.band_rpm
    return np.unique(np.append(np.arange(low, high, step), high))


def _line(scene: Scene, cam: FreeCam, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the safe and of the risky end of a line."""
    design = scene.design
    speeds = [scene.cam_speed(s) for s in np.linspace(*scene.operation.band_rpm, PROGRAM_SPEEDS)]
    program = no_jump_program(build_train(scene), design, cam, speeds)
    kept, tension = rng.uniform(*KEPT_N, 3), np.exp(rng.uniform(*np.log(TENSION_N), 3))
    try:
        safe = program.solve(kept).z
    except NoCamHoldsContact as none:
        safe = program.solve(kept - none.shortfall_N - 1.0).z
    if rng.random() < KINEMATIC:
        return safe, kinematic_optimum(design, cam).z
    return safe, program.solve(-tension).z


def _located(scene: Scene, cam: FreeCam, safe, risky, target: float) -> tuple[np.ndarray, Truth] | None:
    """The cam of the line whose worst share is the target at COARSE_RPM and around the limits at every r/min."""

    def at(s: float) -> np.ndarray:
        return _rounded(safe + s * (risky - safe))

    def share(s: float, step: float) -> tuple[float, Truth]:
        most = MOST if step == 1.0 else COARSE_MOST
        found = truth(scene, cam.lift(at(s)), band(scene, step), enough=AROUND[1], most=most)
        return found.share, found

    low, high = 0.0, 1.0
    if share(low, COARSE_RPM)[0] > AROUND[1] or share(high, COARSE_RPM)[0] < AROUND[0]:
        return None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        value = share(middle, COARSE_RPM)[0]
        low, high = (low, middle) if value > target else (middle, high)
    s, width = 0.5 * (low + high), 0.125
    for _ in range(FULL):
        value, found = share(s, 1.0)
        if AROUND[0] <= value <= AROUND[1]:
            return at(s), found
        s = float(np.clip(s + (width if value < AROUND[0] else -width) * s, 0.0, 1.0))
        width *= 0.6
    return None


def _rounded(z: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.{DIGITS}g}") for value in z])
