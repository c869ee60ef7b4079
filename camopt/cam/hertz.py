"""Line contact of cam and follower: Hertz stress of two elastic cylinders with parallel axes, and the oil film.

With the force per length P, the combined radius R and the combined modulus E*, the largest pressure, in the middle of
the contact, is (Hertz 1881; Johnson, Contact Mechanics, 1985, Eq. (4.45))
    p_0 = sqrt(P E* / (pi R)),   1/R = 1/R_cam + 1/R_follower,   1/E* = (1 - nu_cam^2)/E_cam + (1 - nu_f^2)/E_f.
A flat face has 1/R_follower = 0; a concave flank has a negative radius. The simulated force acts on the valve axis. The
force along the path of the part that touches the cam is this force times the ratio of the valve's velocity to that of
the part, and the normal force is that divided by the cosine of the pressure angle. Friction, edges and oil are
neglected.

The least thickness of the oil film is Dowson's for elastic bodies and a piezoviscous oil (Dowson, Elastohydrodynamics,
Proc. IMechE 182(3A), 1968):
    h / R = 2.65 U^0.7 G^0.54 W^-0.13,   U = eta u / (E' R),   G = alpha E',   W = P / (E' R),
with the entrainment velocity u, the combined radius R, the combined modulus E' = 2 E*, the force per length P, the
viscosity eta at zero pressure and its pressure coefficient alpha. Every angle is treated by itself, without squeezing,
heating and edges: the film vanishes where the entrainment velocity is zero, where squeezing keeps a real one.
"""

from dataclasses import dataclass

import numpy as np

from camopt.cam.contact import Contact
from camopt.cam.geometry import contact
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.geometry import Geometry
from camopt.scene.shapes import Float
from camopt.scene.units import DEG, MM, UM

GPA = 1e9
"""Pascals in a gigapascal."""


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
        """The largest stress in field units, the cam angle where it acts, and the normal force there."""
        stress, theta = self.largest
        force = self.force[int(np.argmax(self.stress))]
        return {"hertz_stress_MPa": stress / 1e6, "cam_angle_deg": theta / DEG, "normal_force_N": float(force)}


def line_pressure(force_per_length, radius, modulus: float) -> np.ndarray:
    """Largest pressure [Pa] of a line contact: force per length [N/m] >= 0, combined radius [m] and modulus [Pa]."""
    return np.sqrt(np.asarray(force_per_length) * modulus / (np.pi * np.asarray(radius)))


def contact_modulus(geometry: Geometry) -> float:
    """Combined modulus E* [Pa] of cam and follower."""
    cam = (1 - geometry.cam_poisson_ratio**2) / (geometry.cam_modulus_GPa * GPA)
    follower = (1 - geometry.follower_poisson_ratio**2) / (geometry.follower_modulus_GPa * GPA)
    return 1 / (cam + follower)


def contact_width(geometry: Geometry) -> float:
    """Length of the line of contact [m]. Raises InputError if the scene gives none."""
    width = geometry.contact_width_mm or geometry.face_width_mm
    if width is None:
        raise InputError("[geometry]: Hertz stress needs the length of the line of contact: give contact_width_mm")
    return width * MM


def hertz_stress(
    lift: Lift, geometry: Geometry, theta: Float[np.ndarray, " k"], force: Float[np.ndarray, " k"]
) -> HertzStress:
    """The stress under a `force` [N] on the valve axis at cam angles `theta` [rad], of any turn. Raises InputError if
    the scene gives no width of the contact, and at a cusp, an undercut or a flank that is too concave."""
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
    """1/R (k) [1/m] of cam and follower; -inf at a cusp or an undercut of the cam."""
    radius = along.geometry.contact_radius_mm
    cam_radius = along.radius_of_curvature
    cam = np.divide(1.0, cam_radius, out=np.full_like(cam_radius, -np.inf), where=cam_radius != 0)
    if radius is None:
        return cam
    undercut = (cam_radius <= 0) & (cam_radius >= -radius * MM)
    return np.where(undercut, -np.inf, cam + 1 / (radius * MM))


def film_ratio(
    along: Contact, cam_speed: float, normal_force: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"] | None:
    """Film thickness over roughness at a cam speed [rad/s] under the normal force [N]; infinite without force, NaN
    without a line contact, None if the scene has no oil or roughness. Raises InputError if it has no width of the
    contact."""
    geometry = along.geometry
    if geometry.oil_viscosity_mPa_s is None or geometry.roughness_um is None:
        return None
    curvature = combined_curvature(along)
    radius = np.divide(1.0, curvature, out=np.full_like(curvature, np.nan), where=curvature > 0)
    modulus = 2 * contact_modulus(geometry)
    speed = geometry.oil_viscosity_mPa_s * 1e-3 * np.abs(along.entrainment) * cam_speed / (modulus * radius)
    load = normal_force / contact_width(geometry) / (modulus * radius)
    oil = geometry.oil_pressure_viscosity_per_GPa / GPA * modulus
    with np.errstate(divide="ignore"):
        return 2.65 * speed**0.7 * oil**0.54 * load**-0.13 * radius / (geometry.roughness_um * UM)
