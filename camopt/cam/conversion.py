"""Conversion between followers: the lift of one follower on the contour that belongs to the lift of another.

The new follower touches each point of the contour, with its normal, at one cam angle and with one lift, both in closed
form. Where these angles do not ascend, the follower would bridge a hollow, and its velocity would be discontinuous.
"""

import numpy as np

from camopt.cam.contact import Contact
from camopt.cam.followers import follower_of
from camopt.cam.geometry import contact
from camopt.cam.lift import Lift
from camopt.cam.tables.interpolation import centred, spline_pieces
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG

STEP_DEG = 0.1
"""Spacing [deg] of the points that are converted. The quintic pieces between them are within 1e-9 mm if the jerk of the
lift has no step, and within 1e-7 mm if it has."""


def lift_along(measured: Contact, geometry: Geometry) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Ascending cam angles (k) [rad] at which the follower of `geometry` touches the points of a contour, and its valve
    lift (k) [m] there. Raises InputError if it would bridge a hollow."""
    theta, lift = follower_of(geometry).lift_on(measured.contour @ (1, 1j), measured.normal @ (1, 1j))
    theta = np.unwrap(theta)
    theta += 2 * np.pi * np.round((measured.theta[0] - theta[0]) / (2 * np.pi))
    back = np.flatnonzero(np.diff(theta) < -1e-9 * np.diff(measured.theta))
    if len(back):
        raise InputError(
            f"conversion: at {theta[back[0]] / DEG:.1f} deg the {geometry.follower} follower would bridge a hollow of "
            f"the contour: it needs a contour that is convex, or as hollow as its own radius at most"
        )
    return theta, lift


def converted(lift: Lift, measured_by: Geometry, follower: Geometry) -> Lift:
    """The valve lift of a scene's `follower` on the cam that gives the follower `measured_by` the lift `lift`.

    The cam angle is that of the engine with either follower. Raises InputError if no contour gives `measured_by` this
    lift, or if the other follower cannot follow that contour.
    """
    degrees = np.linspace(-180.0, 180.0, round(360 / STEP_DEG) + 1)
    contact(lift, measured_by).require_contour("conversion")
    theta, height = lift_along(contact(lift, measured_by, degrees * DEG), follower)
    pieces = spline_pieces("conversion", theta, height)
    borders, coefficients = centred(pieces, 0.0)
    return Lift(borders, coefficients, lift.half_duration, lift.family, lift.parameters)
