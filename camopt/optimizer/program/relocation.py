"""Relinearisation of the no-jump program about the event-exact motion of its own cam, at the switching angles of it."""

import numpy as np

from camopt.cam.lift import Lift
from camopt.exact.engine import prepare
from camopt.optimizer.program.no_jump import NoJumpProgram
from camopt.optimizer.program.phases import Angles, tangents_along, usual_margin
from camopt.optimizer.program.program_cam import with_radii, with_radii_near, with_switches
from camopt.scene.response import Response, end_state
from camopt.scene.rest import is_linear, state_at_rest
from camopt.scene.train import Train

REVOLUTIONS = 8
"""Number of revolutions from rest to the one whose angles are used: surge decays by half or more in each."""
CONVERGED, ROUGHLY_CONVERGED = 1e-5, 5e-5
"""Changes of the area ratio below which the tangents count as converged, and as roughly converged: a fifth of the
search's resolution, and half a unit of the fourth digit."""
MOST_SOLUTIONS = 8
NONE_HOLDS = 2
"""Number of successive programs without a cam that keeps the margin after which no such cam is expected."""


class NoLoadTransfer(ValueError):
    """A motion lacks part of the sequence lash closes, seat opens, seat closes, lash opens."""


def located_angles(response: Response) -> Angles:
    """The switching angles [rad] of one revolution of a motion, from -pi to pi.

    The seat opens for the last time before the middle, and it closes for the first time after the greatest valve lift.
    The lash closes for the last time before the seat opens, and it opens for the first time after the seat closes.
    Crossings between samples are interpolated linearly. If the train is not linear, the tangents along the motion are
    included. Raises NoLoadTransfer where one of the four angles is missing.
    """
    train, theta = response.train, response.angle
    margin = train.compression(response.x, response.lift) - train.touch_compression
    seat = margin[:, train.seat]
    top = theta[np.argmax(-seat)]
    seat_opens = _crossing(theta, -seat, -np.pi, 0.0, last=True, what="the seat opens")
    seat_closes = _crossing(theta, seat, top, np.pi, last=False, what="the seat closes")
    lash = [e for e in train.cam_side if margin[0, e] < 0]
    if not lash:
        return Angles(seat_opens, seat_opens, seat_closes, seat_closes, tangents_along(response))
    gap = margin[:, lash].min(axis=1)
    lash_closes = _crossing(theta, gap, -np.pi, seat_opens, last=True, what="the lash closes")
    lash_opens = _crossing(theta, -gap, seat_closes, np.pi, last=False, what="the lash opens")
    return Angles(lash_closes, seat_opens, seat_closes, lash_opens, tangents_along(response))


def _crossing(theta, value, low, high, last: bool, what: str) -> float:
    """Angle in [low, high] at which `value` goes from negative to zero or more."""
    crossings = np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0) & (theta[1:] >= low) & (theta[:-1] <= high))
    if len(crossings) == 0:
        raise NoLoadTransfer(f"the motion has no angle at which {what}")
    i = crossings[-1 if last else 0]
    fraction = value[i] / (value[i] - value[i + 1])
    return float(np.clip(theta[i] + fraction * (theta[i + 1] - theta[i]), low, high))


def settled_revolution(train: Train, lift: Lift, cam_speed: float, revolutions: int = REVOLUTIONS) -> Response:
    """The last of `revolutions` event-exact revolutions from rest at `cam_speed` [rad/s]."""
    revolve = prepare(train, lift, cam_speed)
    state = state_at_rest(train)
    for _ in range(revolutions):
        response = revolve(state)
        state = end_state(response)
    return response


def relocate(program: NoJumpProgram, lift: Lift) -> NoJumpProgram:
    """The program at the switching angles of the event-exact motion with `lift` at each speed, and with the radii under
    a roller or pad linearised near that cam. A speed whose motion has no clear load transfer keeps its previous angles.
    """
    angles = []
    for block in program.blocks:
        try:
            angles.append(located_angles(settled_revolution(program.train, lift, block.cam_speed)))
        except NoLoadTransfer:
            angles.append(block.angles)
    return with_radii_near(program.relocated(angles), lift)


def converge_tangents(program: NoJumpProgram, margin_N: float | None = None, quick: bool = False) -> NoJumpProgram:
    """The program linearised about the motion of its own cam, repeatedly until its area converges.

    First `with_switches` and `with_radii` are applied; for a linear train these are all that is needed. The margin on
    all contact forces, by default `usual_margin`, is reduced as far as no cam can keep it. With `quick` the iteration
    ends once the area has roughly converged, or after NONE_HOLDS successive programs without a cam that keeps the
    margin. Raises NoCamHoldsContact where the limits on the shape permit no cam.
    """
    margin_N = usual_margin(program.train) if margin_N is None else margin_N
    program = with_radii(with_switches(program, margin_N), margin_N)
    if is_linear(program.train):
        return program
    area, failures = -np.inf, 0
    for _ in range(MOST_SOLUTIONS):
        optimum = program.solve_below(margin_N)
        failures = failures + 1 if optimum.margins.min() < margin_N else 0
        change = abs(optimum.area_ratio - area)
        if change < CONVERGED or (quick and (change < ROUGHLY_CONVERGED or failures == NONE_HOLDS)):
            break
        area, program = optimum.area_ratio, relocate(program, optimum.lift)
    return program
