"""The table [geometry] of a scene: the follower that a cam drives, its cam body, materials, oil and surfaces."""

from math import hypot
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from camopt.scene.table import NonNegative, Positive, Table

PoissonRatio = Annotated[float, Field(ge=0, le=0.5)]
SWINGING = ("finger", "rocker")
"""Followers that swing about a pivot."""
BELONGS = {
    "roller_radius_mm": (("roller",), ("roller", *SWINGING)),
    "pad_radius_mm": ((), SWINGING),
    "pivot_mm": (SWINGING, SWINGING),
    "arm_mm": (SWINGING, SWINGING),
    "valve_arm_mm": (SWINGING, SWINGING),
}
"""Key -> the followers that require it, and those that may have it."""


class Geometry(Table, frozen=True):
    """Follower and cam body, for curvature, contact, stress and oil film along the cam.

    A flat face or a roller moves along the valve axis, which passes through the cam axis. `rocker_ratio` is valve lift
    over follower lift.

    A finger or rocker swings about `pivot_mm` = [across, along], two coordinates with their origin on the cam axis. The
    coordinate along the valve axis is positive in the direction in which the valve opens. The coordinate across it is
    positive opposite to the direction in which the cam's surface moves on the side to which the valve opens.

    `arm_mm` is the distance from the pivot to the centre of the roller, or of the circle of the pad, that touches the
    cam. `valve_arm_mm` is the distance from the pivot to the centre of the pad on the flat valve tip. `valve_arm_deg`
    is the angle between that arm and the perpendicular to the valve axis with the valve shut, positive if the arm
    points in the opening direction. Seen from the pivot, the valve of a finger is on the cam's side, that of a rocker
    on the other.

    `face_width_mm` is the width of the flat face across the cam axis. `contact_width_mm` is the length of the line of
    contact, along the cam axis, and is the face width if left out. The moduli and Poisson's ratios default to those of
    steel. `hertz_max_MPa` is the stress that the pair of materials endures according to its makers: it is reported
    beside the stress of the cam and is not a limit.

    The oil film needs `oil_viscosity_mPa_s` at the temperature of the contact, `oil_pressure_viscosity_per_GPa` and
    `roughness_um`, the root mean square roughness of cam and follower together.
    """

    follower: Literal["flat", "roller", "finger", "rocker"]
    base_radius_mm: Positive
    face_width_mm: Positive | None = None
    roller_radius_mm: Positive | None = Field(default=None, validate_default=True)
    pad_radius_mm: Positive | None = Field(default=None, validate_default=True)
    rocker_ratio: Positive = 1.0
    pivot_mm: tuple[float, float] | None = Field(default=None, validate_default=True)
    arm_mm: Positive | None = Field(default=None, validate_default=True)
    valve_arm_mm: Positive | None = Field(default=None, validate_default=True)
    valve_arm_deg: Annotated[float, Field(gt=-80, lt=80)] = 0.0
    contact_width_mm: Positive | None = None
    cam_modulus_GPa: Positive = 210.0
    cam_poisson_ratio: PoissonRatio = 0.3
    follower_modulus_GPa: Positive = 210.0
    follower_poisson_ratio: PoissonRatio = 0.3
    hertz_max_MPa: Positive | None = None
    oil_viscosity_mPa_s: Positive | None = None
    oil_pressure_viscosity_per_GPa: NonNegative = 20.0
    roughness_um: Positive | None = None
    assumed: tuple[str, ...] = ()
    source: str = ""

    @field_validator(*BELONGS)
    @classmethod
    def _of_its_follower(cls, value, info: ValidationInfo):
        follower = info.data.get("follower")
        if follower is None or info.field_name is None:
            return value
        needed, allowed = BELONGS[info.field_name]
        if value is None and follower in needed:
            raise ValueError(f"missing; a {follower} has one")
        if value is not None and follower not in allowed:
            raise ValueError(f"belongs to {' and '.join(f'{kind}s' for kind in allowed)} only: leave it out")
        return value

    @property
    def contact_radius_mm(self) -> float | None:
        """Radius [mm] of the roller or pad that touches the cam; None for a flat face."""
        return self.roller_radius_mm or self.pad_radius_mm

    @model_validator(mode="after")
    def _assembles(self):
        if self.follower not in SWINGING:
            return self
        if (self.roller_radius_mm is None) == (self.pad_radius_mm is None):
            raise ValueError(f"a {self.follower} rides on the cam by one of roller_radius_mm and pad_radius_mm")
        if self.rocker_ratio != 1.0:
            raise ValueError(f"rocker_ratio belongs to flats and rollers only: a {self.follower} has its arms")
        assert self.pivot_mm and self.arm_mm and self.contact_radius_mm, "by _of_its_follower"
        if self.pivot_mm[0] == 0:
            raise ValueError("pivot_mm must lie beside the line along which the valve opens: give it a distance across")
        away, reach = hypot(*self.pivot_mm), self.base_radius_mm + self.contact_radius_mm
        if not abs(self.arm_mm - away) < reach < self.arm_mm + away:
            raise ValueError(
                f"arm_mm = {self.arm_mm:g} does not reach from the pivot, {away:g} mm from the cam's axis, to the "
                f"centre of a contact of radius {self.contact_radius_mm:g} mm on the base circle, {reach:g} mm from it"
            )
        return self
