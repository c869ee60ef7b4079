"""Polydyne against Eqs. (1) to (3) of Kodama et al., and against coefficients computed elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.exponent import exponent
from camopt.cam.families.polydyne import equivalent_train, polydyne
from camopt.cam.polynomials import osculating_pieces
from camopt.scene import InputError, build_train, load_scene, parse_scene
from camopt.scene.units import DEG, MM, MM_PER_DEG, MM_PER_DEG2, MM_PER_DEG3
from tests.cam.cams import KODAMA

HALF = 72 * DEG


def test_calibrated_member_of_the_reference_fit():
    """Coefficients, nose lift and peaks as the fit of the reference train states them (exponents 2-12-20-32-34)."""
    a, b = 1.02, 9.22 * DEG**2
    lift = polydyne(KODAMA, (2, 12, 20, 32, 34), ramp_height_mm=0.25, dynamic=(a, b))
    powers = np.array([0, 2, 12, 20, 32, 34])
    c = np.array([1.0, -1.48482, 1.12132, -0.92831, 0.92071, -0.62891]) * 9.01728 * MM
    x = np.linspace(0.0, 1.0, 50)[:, None]
    second = np.where(powers > 1, powers * (powers - 1) * x ** np.maximum(powers - 2, 0), 0.0) / HALF**2
    stated = 0.25 * MM + (a * x**powers + b * second) @ c
    assert np.abs(lift(x[:, 0] * HALF) - stated).max() < 2e-4 * MM  # the coefficients are printed to five digits
    assert lift(0.0) == pytest.approx(9.4 * MM, abs=1e-15)
    low, high = lift.extremes(2, -HALF, HALF)
    assert (low / MM_PER_DEG2, high / MM_PER_DEG2) == pytest.approx((-0.00527, 0.01424), abs=1e-5)
    assert lift.extremes(3, -HALF, HALF)[1] / MM_PER_DEG3 == pytest.approx(0.01716, abs=1e-5)
    assert lift.area_ratio(9.4 * MM) == pytest.approx(0.5716, abs=5e-5)


@pytest.mark.parametrize("exponents", [(2, 10, 18, 26, 34), (4, 12, 26, 34, 50), (2, 8.5, 20, 30, 41.3)])
def test_conditions_of_the_flank_end(exponents):
    lift = polydyne(KODAMA, exponents)
    a, b = lift.parameters["A"], lift.parameters["B_deg2"] * DEG**2
    inner = HALF * (1 - 1e-13)
    assert lift(inner) == pytest.approx(0.265 * MM, rel=1e-9)  # y = 0, y'' = 0
    assert lift(inner, 1) == pytest.approx(-0.011 * MM_PER_DEG, rel=1e-9)  # B y''' is the ramp velocity, y' = 0
    assert lift(inner, 2) == pytest.approx(0.0, abs=1e-8 * MM_PER_DEG2)  # A y'' + B y'''' = 0
    assert lift(0.0) == pytest.approx(9.4 * MM, rel=1e-12)
    assert lift(np.array([0.3, 0.9]), 2) == pytest.approx(lift(-np.array([0.3, 0.9]), 2), rel=1e-9)
    assert a == pytest.approx(1.00125, abs=1e-5)
    assert b / DEG**2 == pytest.approx(3.37, abs=0.01)  # at 7000 r/min


def test_pieces_meet_the_power_law_between_their_borders():
    lift = polydyne(KODAMA, dynamic=(1.0, 1e-3))
    theta = np.linspace(0.01, HALF - 0.01, 400)
    a, b, x = 1.0, 1e-3, theta / HALF
    powers = np.array([0, 2, 10, 18, 26, 34])

    def columns(order):
        factor = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(6)
        return np.where(factor != 0, factor * x[:, None] ** np.maximum(powers - order, 0), 0.0) / HALF**order

    law = a * columns(0) + b * columns(2)
    c, *_ = np.linalg.lstsq(law, lift(theta) - 0.265 * MM, rcond=None)
    assert lift(theta) - 0.265 * MM == pytest.approx(law @ c, abs=1e-12 * MM)
    assert lift(theta, 3) == pytest.approx((a * columns(3) + b * columns(5)) @ c, rel=1e-6, abs=1e-8 * MM_PER_DEG3)


def test_equivalent_train_is_the_series_stiffness_and_the_moving_mass():
    train = build_train(KODAMA)
    series = 1 / np.sum(1 / np.array([1.52e8, 8.12e7, 9.18e7, 8.01e7, 1.42e8]))
    k_e, k_sp, mass = equivalent_train(train)
    assert k_e == pytest.approx(series, rel=5e-3)
    assert k_sp == pytest.approx(152000 / 6, rel=1e-3)
    assert mass == pytest.approx(0.0509 + 0.0312 + 0.0229 + 0.037 + 0.00833 * 55 / 36, rel=5e-3)
    assert equivalent_train(build_train(load_scene("motori-1"))) == pytest.approx((1.5e8, 38200.0, 0.24))


def changed(scene, name, **update):
    """The scene with keys of one element changed."""
    return scene.model_copy(
        update={"element": tuple(e.model_copy(update=update) if e.name == name else e for e in scene.element)}
    )


def chain(*elements):
    """A train of equal masses of 0.1 kg from (kind, between, stiffness, preload); "m0" is the valve, the last its seat.

    The first element is driven by the cam.
    """
    names = sorted({n for _, ends, *_ in elements for n in ends} - {"ground"})
    lines = ["format = 1", 'name = "chain"', f'valve = "{names[0]}"', f'seat = "e{len(elements) - 1}"']
    for name in names:
        lines += ["[[mass]]", f'name = "{name}"', "mass_kg = 0.1", "force_N = -1.0"]
    for i, (kind, ends, stiffness, preload) in enumerate(elements):
        lines += ["[[element]]", f'name = "e{i}"', f'kind = "{kind}"', f"between = {list(ends)}"]
        lines += [f"stiffness_N_per_m = {stiffness}", f"preload_N = {preload}", f"cam_driven = {str(i == 0).lower()}"]
    return build_train(parse_scene("\n".join(lines), "chain"))


SPRING, SEAT = ("spring", ("m0", "ground"), 4e4, 300.0), ("contact", ("ground", "m0"), 1e8, 300.0)
SPRING_RODS = {
    "a rod between two contacts": [("contact", ("ground", "m2"), 3e7, 0.0), ("spring", ("m2", "m1"), 2e7, 0.0),
                                   ("contact", ("m1", "m0"), 6e7, 0.0)],
    "springs behind one contact": [("contact", ("ground", "m2"), 3e7, 0.0), ("spring", ("m2", "m1"), 2e7, 0.0),
                                   ("spring", ("m1", "m0"), 6e7, 0.0)],
    "a rod of spring at the valve": [("contact", ("ground", "m2"), 3e7, 0.0), ("contact", ("m2", "m1"), 2e7, 0.0),
                                     ("spring", ("m1", "m0"), 6e7, 0.0)],
    "contacts alone": [("contact", ("ground", "m2"), 3e7, 0.0), ("contact", ("m2", "m1"), 2e7, 0.0),
                       ("contact", ("m1", "m0"), 6e7, 0.0)],
}  # fmt: skip


@pytest.mark.parametrize("rods", SPRING_RODS.values(), ids=SPRING_RODS)
def test_equivalent_train_of_a_chain_is_in_series_whatever_its_elements(rods):
    k_e, k_sp, mass = equivalent_train(chain(*rods, SPRING, SEAT))
    series = 1 / (1 / 3e7 + 1 / 2e7 + 1 / 6e7)
    assert k_e == pytest.approx(series, rel=1e-9)
    assert k_sp == pytest.approx(4e4, rel=1e-9)
    force = 4e4  # on every element, for a valve lifted by 1 m
    shares = 1 + force * np.array([0.0, 1 / 6e7, 1 / 6e7 + 1 / 2e7])
    assert mass == pytest.approx(0.1 * np.sum(shares**2), rel=1e-9)


def test_a_rod_of_spring_is_as_good_as_one_of_contact():
    scene = load_scene("pushrod-5mass")
    elastic = changed(scene, "pushrod", kind="spring")
    assert equivalent_train(build_train(elastic)) == pytest.approx(equivalent_train(build_train(scene)), rel=1e-9)
    assert polydyne(elastic).area == pytest.approx(polydyne(scene).area, rel=1e-9)


def test_a_train_whose_cam_lifts_nothing_is_refused():
    train = build_train(load_scene("motori-1"))
    with pytest.raises(InputError, match=r"no equivalent of one mass.*'valve'.*check what the cam drives"):
        equivalent_train(replace(train, cam_driven=np.zeros(len(train.a), dtype=bool)))


@pytest.mark.parametrize("name", ["kodama", "kodama-hertz", "motori-1", "motori-2", "pushrod-5mass"])
def test_every_built_in_scene_has_a_plain_member(name):
    scene = load_scene(name)
    lift = polydyne(scene)
    assert lift.max_lift == pytest.approx(scene.design.max_lift_mm * MM, rel=1e-9)
    assert lift.extremes(1, -lift.half_duration, 0.0)[0] >= -1e-9 * lift.extremes(1)[1]


LEAVING = {
    "it rises beyond the maximum lift": ("motori-1", (2, 6, 10, 14, 18), 5000, {}, r"would rise to 20\.02 mm .* 9\.4;"),
    "its flank falls": ("motori-1", (2, 4, 26, 30, 36), 4000, {}, r"rise to|would fall, by up to"),
    "rigid": ("motori-1", (2, 10, 18, 26, 34), 5000, {"stiffness_N_per_m": 1e14}, "a higher speed_rpm"),
    "soft": ("motori-1", (2, 10, 18, 26, 34), 7000, {"stiffness_N_per_m": 1e5}, "a lower speed_rpm"),
}


@pytest.mark.parametrize("case", LEAVING.values(), ids=LEAVING)
def test_a_correction_that_leaves_the_family_is_refused(case):
    """The cam of motori-1 with exponents 2/6/10/14/18 rose to 20.02 mm under a limit of 9.4 mm without a word."""
    name, exponents, speed, train, why = case
    with pytest.raises(
        InputError, match=f"^polydyne: the dynamic correction gives no valid cam.*{why}.*family exponent"
    ):
        polydyne(changed(load_scene(name), "train", **train), exponents, speed)


def test_conditions_without_a_solution_are_refused_and_no_defect():
    """A and B for which the nose's condition depends on the others: the linear system is singular."""
    scene = load_scene("motori-1")
    b = -singular_factor(scene)
    with pytest.raises(InputError, match="gives no valid cam"):
        polydyne(scene, dynamic=(1.0, b))


def test_exponents_that_rounding_cannot_tell_apart_are_refused():
    """Exponents 8.001 to 8.005 gave 9.54 mm of lift for 9.4 without a word."""
    with pytest.raises(InputError, match=r"^exponent: exponents 8\.001/.* give no cam: .*further apart"):
        exponent(KODAMA, (8.001, 8.002, 8.003, 8.004, 8.005))


def singular_factor(scene):
    """Nose lift of y over its second derivative, for the homogeneous conditions at the flank's end."""
    powers, half = np.array([0, 2, 10, 18, 26, 34.0]), scene.design.duration_deg * DEG / 2
    ends = np.array([np.prod([powers - i for i in range(k)], axis=0) if k else np.ones(6) for k in range(5)])
    unknowns = np.linalg.svd(ends / abs(ends).max(axis=1, keepdims=True))[2][-1]
    return float(unknowns[0] / (2 * unknowns[1] / half**2))


@pytest.mark.parametrize("exponents", [(2, 2, 3, 4, 5), (2, 10, 18, 26), (1, 10, 18, 26, 34), (2, 4.5, 18, 26, 34)])
def test_unusable_exponents_are_refused(exponents):
    with pytest.raises(InputError, match="polydyne: exponents"):
        polydyne(KODAMA, exponents)


def test_osculating_pieces_carry_value_and_five_derivatives():
    borders = np.array([0.0, 0.4, 1.0])
    orders = np.arange(6)
    exact = np.exp(2 * borders)[:, None] * 2.0**orders
    pieces = osculating_pieces(borders, exact)
    middle = np.array([sum(c * u**k for k, c in enumerate(p)) for p, u in zip(pieces, (0.2, 0.3), strict=True)])
    assert middle == pytest.approx(np.exp(2 * np.array([0.2, 0.7])), rel=1e-11)
