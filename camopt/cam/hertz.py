"""Hertz stress between cam and follower: line contact of two elastic cylinders with parallel axes (Hertz 1881).

With P the force per length of the line, R the radii's and E* the moduli's combination, the largest pressure, in the
middle of the contact, is (Johnson, Contact Mechanics, 1985, Eq. (4.45))
    p_0 = sqrt(P E* / (pi R)),   1/R = 1/R_cam + 1/R_follower,   1/E* = (1 - nu_cam^2)/E_cam + (1 - nu_f^2)/E_f.
A flat face has 1/R_follower = 0; a concave flank counts with a negative radius. The force along the way of what rides
on the cam is the simulated one, which acts on the valve's axis, times the ratio of the valve's velocity to its own; the
normal force that of it over the cosine of the pressure angle. Friction, edges and lubrication are left out.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.geometry import Contact, contact
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM

GPA = 1e9
"""Pascals in a gigapascal."""
MPA = 1e6
"""Pascals in a megapascal."""


@dataclass(frozen=True)
class HertzStress:
    """Along the cam at angles `theta` [rad]: normal `force` [N] and largest pressure `stress` [Pa]."""

    theta: Float[np.ndarray, " k"]
    force: Float[np.ndarray, " k"]
    stress: Float[np.ndarray, " k"]

    def __repr__(self) -> str:
        stress, angle = self.largest
        return f"HertzStress(largest {stress / 1e6:.5g} MPa at {angle / DEG:.5g} deg, {len(self.theta)} angles)"

    @property
    def largest(self) -> tuple[float, float]:
        """Largest stress [Pa] and the cam angle [rad], from -pi to pi, where it acts."""
        i = int(np.argmax(self.stress))
        return float(self.stress[i]), float(np.mod(self.theta[i] + np.pi, 2 * np.pi) - np.pi)

    def figures(self) -> dict[str, float]:
        """The largest stress in the field's units, where it acts, and the force there."""
        stress, theta = self.largest
        force = self.force[int(np.argmax(self.stress))]
        return {"hertz_stress_MPa": stress / MPA, "cam_angle_deg": theta / DEG, "normal_force_N": float(force)}


def line_pressure(force_per_length, radius, modulus: float) -> np.ndarray:
    """Largest pressure [Pa] of a line contact: force per length [N/m] >= 0, combined radius [m] and modulus [Pa]."""
    return np.sqrt(np.asarray(force_per_length) * modulus / (np.pi * np.asarray(radius)))


def contact_modulus(geometry: Geometry) -> float:
    """Combined modulus E* [Pa] of cam and follower."""
    cam = (1 - geometry.cam_poisson_ratio**2) / (geometry.cam_modulus_GPa * GPA)
    follower = (1 - geometry.follower_poisson_ratio**2) / (geometry.follower_modulus_GPa * GPA)
    return 1 / (cam + follower)


def contact_width(geometry: Geometry) -> float:
    """Length of the line of contact [m]; InputError where the scene gives none."""
    width = geometry.contact_width_mm or geometry.face_width_mm
    if width is None:
        raise InputError("[geometry]: Hertz stress needs the length of the line of contact: give contact_width_mm")
    return width * MM


def hertz_stress(
    lift: Lift, geometry: Geometry, theta: Float[np.ndarray, " k"], force: Float[np.ndarray, " k"]
) -> HertzStress:
    """The stress under a `force` [N] on the valve's axis at cam angles `theta` [rad], any turn.

    Raises InputError where the scene gives no width of the contact, and where the contour cannot carry the follower
    along a line: a cusp or concave flank under a flat face, an undercut under a roller or pad.
    """
    width, along = contact_width(geometry), contact(lift, geometry, theta)
    curvature = combined_curvature(along)
    if np.any(curvature <= 0):
        at = theta[int(np.argmax(curvature <= 0))] / DEG
        raise InputError(
            f"[geometry]: no line contact at {at:.1f} deg: "
            "the contour has a cusp, an undercut or too concave a flank there; change the base radius"
        )
    normal = force * along.ratio / np.cos(along.pressure_angle)
    stress = line_pressure(normal / width, 1 / curvature, contact_modulus(geometry))
    return HertzStress(theta, normal, stress)


def combined_curvature(along: Contact) -> np.ndarray:
    """1/R (k) [1/m] of cam and follower; -inf where the cam has a cusp."""
    radius = along.geometry.contact_radius_mm
    own = along.radius_of_curvature
    cam = np.divide(1.0, own, out=np.full_like(own, -np.inf), where=own != 0)
    if radius is None:
        return cam
    undercut = (own <= 0) & (own >= -radius * MM)
    return np.where(undercut, -np.inf, cam + 1 / (radius * MM))
