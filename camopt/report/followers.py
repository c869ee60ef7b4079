"""A follower as the animation draws it: the room that it takes about the cam, and a swinging arm's parts."""

from dataclasses import dataclass

import numpy as np

from camopt.cam.followers import Arm
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.units import MM

BASE_MM = 16.0
"""Base circle radius that is drawn where the scene has no [geometry]."""
PIVOT_MM = 4.0
"""Room about a pivot."""
SWING_MM = 12.0
"""Room above what a rising cam lifts."""


@dataclass(frozen=True)
class FollowerRoom:
    """How far cam and follower reach from the cam's axis on the base circle [mm], and where across, from there, the
    valve's train stands."""

    left: float
    right: float
    above: float
    below: float
    train: float = 0.0


def drawn_follower(geometry: Geometry | None) -> dict:
    """The page's `follower`, `roller_radius_mm`, `base_radius_mm`, `turn` and `arm`.

    `turn` is -1 where the picture is the mirror image, so that the train stands to the right of the cam; `arm` is None
    or a swinging body with the valve shut: `pivot`, `centre` and `valve` [mm from the cam's axis, right and down],
    `radius` [mm], whether it `rolls`, its valve arm's length `valve_arm_mm` and angle `shut_deg`, and the `side` of
    the pivot on which that arm lies.
    """
    if geometry is None:
        return {"follower": "point", "roller_radius_mm": 0.0, "base_radius_mm": BASE_MM, "turn": 1, "arm": None}
    drawn = {
        "follower": geometry.follower,
        "roller_radius_mm": geometry.roller_radius_mm or 0.0,
        "base_radius_mm": geometry.base_radius_mm,
        "turn": 1,
        "arm": None,
    }
    if geometry.follower not in SWINGING:
        return drawn
    arm = Arm(geometry)
    turn = 1 if arm.valve[1] >= 0 else -1
    places = {name: _right_and_down(getattr(arm, name), turn) for name in ("pivot", "centre", "valve")}
    return drawn | {
        "turn": turn,
        "arm": {
            **places,
            "radius": arm.radius / MM,
            "rolls": geometry.roller_radius_mm is not None,
            "valve_arm_mm": geometry.valve_arm_mm,
            "shut_deg": geometry.valve_arm_deg,
            "side": turn * arm.valve_side,
        },
    }


def room_for(drawn: dict, radius_mm: float) -> FollowerRoom:
    """The room of a follower that `drawn_follower` tells of, about cams of a largest radius."""
    arm = drawn["arm"]
    if arm is None:
        below = drawn["base_radius_mm"] + 2 * drawn["roller_radius_mm"]
        return FollowerRoom(radius_mm, radius_mm, radius_mm, below)
    places = np.array([arm["pivot"], arm["centre"], arm["valve"]])
    reach = np.array([PIVOT_MM, arm["radius"], PIVOT_MM])
    right, below = np.maximum((places + reach[:, None]).max(axis=0), radius_mm)
    left, above = np.maximum((reach[:, None] - places).max(axis=0), radius_mm)
    return FollowerRoom(left, right, above + (SWING_MM if arm["centre"][1] < 0 else 0.0), below, arm["valve"][0])


def _right_and_down(point: np.ndarray, turn: int) -> list[float]:
    """A point (2) [m] of the engine's frame as the page counts it [mm]."""
    return [round(float(turn * point[1] / MM), 4), round(float(point[0] / MM), 4)]
