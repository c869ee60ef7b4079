"""The valve's lift by the crank's angle, as engine simulations read it: a row each degree, with the lift in mm.

Two columns without a header, parted by a tab, are what EngMod4T takes: the valve's static lift, which is the cam's less
the lash, or its lift at a speed, from a motion. Degree 0 is the last whole one before the valve opens.
"""

from pathlib import Path

import numpy as np

from camopt.cam.exports import rounded
from camopt.cam.geometry import crossing
from camopt.cam.lift import Lift
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM
from camopt.storage import write_text

NOTHING = 5e-4 * MM
"""Lift [m] from which a valve without lash counts as open."""


def crank_rows(lift: Lift, lash: float, cam_per_crank: float) -> Float[np.ndarray, " k"]:
    """Crank angles [deg] from the middle of the cam's duration, a degree apart, from before the opening to after the
    closing, which are where the lift passes the lash [m], or half a micrometre without one.

    Raises InputError where the lift never does.
    """
    opens, closes = (angle / DEG / cam_per_crank for angle in crossing(lift, max(lash, NOTHING)))
    return np.arange(np.floor(opens), np.ceil(closes) + 1)


def static_lift(lift: Lift, lash: float, theta: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """The valve's lift [m] at cam angles [rad] where it follows the cam: max(0, lift - lash)."""
    return np.maximum(lift(theta) - lash, 0.0)


def write_valve_lift(path: str | Path, lift: Float[np.ndarray, " k"], digits: int) -> None:
    """Writes a valve's lifts [m], a crank degree apart, with this many decimals of a millimetre."""
    rows = enumerate(rounded(lift / MM, digits))
    write_text(path, "".join(f"{degree}\t{height}\n" for degree, height in rows))
