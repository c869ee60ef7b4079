"""Oil film between cam and follower: least thickness in a line contact, and its ratio to the roughness; report only.

Dowson's formula for elastic bodies and a piezoviscous oil (Dowson, Elastohydrodynamics, Proc. IMechE 182(3A), 1968):
    h / R = 2.65 U^0.7 G^0.54 W^-0.13,   U = eta u / (E' R),   G = alpha E',   W = P / (E' R),
with u the entrainment velocity, R the radii's and E' = 2 E* the moduli's combination, P the force per length, eta the
viscosity without pressure and alpha its growth with it. Every angle is taken by itself, without squeeze, heat and
edges: the film vanishes where the entrainment reverses, where squeezing carries a real one over.
"""

import numpy as np

from camopt.cam.geometry import Contact
from camopt.cam.hertz import GPA, combined_curvature, contact_modulus, contact_width
from camopt.scene.shapes import Float
from camopt.scene.units import UM

MPA_S = 1e-3
"""Pascal seconds in a millipascal second."""


def film_ratio(
    along: Contact, cam_speed: float, normal_force: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"] | None:
    """Film thickness over roughness at a cam speed [rad/s] under the normal force [N]; infinite without force, and not
    a number where there is no line contact (`camopt.cam.hertz.hertz_stress` refuses such a cam).

    None where the scene states no oil or no roughness. Raises InputError where it gives no width of the contact.
    """
    geometry = along.geometry
    if geometry.oil_viscosity_mPa_s is None or geometry.roughness_um is None:
        return None
    curvature = combined_curvature(along)
    radius = np.divide(1.0, curvature, out=np.full_like(curvature, np.nan), where=curvature > 0)
    modulus = 2 * contact_modulus(geometry)
    speed = geometry.oil_viscosity_mPa_s * MPA_S * np.abs(along.entrainment) * cam_speed / (modulus * radius)
    load = normal_force / contact_width(geometry) / (modulus * radius)
    oil = geometry.oil_pressure_viscosity_per_GPa / GPA * modulus
    with np.errstate(divide="ignore"):
        return 2.65 * speed**0.7 * oil**0.54 * load**-0.13 * radius / (geometry.roughness_um * UM)
