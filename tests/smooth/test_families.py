"""Gradients of every family by every free parameter against central differences of the family's own constructor."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from camopt.cam.families.dwell import TABLES
from camopt.cam.families.free import free_cam
from camopt.cam.families.record import family_named, number, numbers
from camopt.cam.families.registry import FAMILIES
from camopt.cam.families.sections import close_flank, opening_flank
from camopt.cam.lift import Lift
from camopt.cam.ramps import scene_ramps
from camopt.scene import InputError, load_scene
from camopt.scene.units import DEG, MM
from camopt.smooth.families import differentiable

KODAMA = load_scene("kodama")
DESIGN = KODAMA.design
assert DESIGN is not None
FREE = free_cam(DESIGN, 12.0)
GIVEN = {
    "polydyne": {"exponents": (2, 10, 18, 26.5, 34), "speed_rpm": 6000.0},
    "exponent": {"exponents": (2, 8.5, 14, 20, 26)},
    "multi-pol": {
        "sections_deg": (10, 7, 7, 27, 21),
        "a12_mm_per_deg2": 0.0114,
        "j34_mm_per_deg3": -0.00175,
        "j45_mm_per_deg3": -0.00014,
    },
    "new-design": {
        "sections_deg": (8, 14, 19, 31),
        "a12_mm_per_deg2": 0.012,
        "j34_mm_per_deg3": -0.0002,
        "j23_mm_per_deg3": -0.001,
        "start_ratio": 0.8,
        "quintic": True,
    },
    "kurz": {"sections_deg": (24, 25, 23), "a23_mm_per_deg2": -0.0078},
    "trapezoid": {"sections_deg": (5, 8, 13, 46)},
}
"""A member of every family away from ties, by the names of the command line; the others have no parameters."""
DETERMINED = {"multi-pol": {"a45_mm_per_deg2"}, "new-design": {"a34_mm_per_deg2"}, "polydyne": {"ramp_height_mm"}}
"""What the maximum lift determines, and what is a design condition."""
PEAKS = [(0, False), (1, False), (1, True), (2, False), (2, True), (3, False), (3, True)]
THETA = np.linspace(-1.75, 1.75, 141)
STEP = 1e-3
"""Relative step of the differences, of fourth order: their error is 1e-12 of a fifth derivative."""
ROUND_OFF, JERK_ROUND_OFF = 1e-12, 2e-11
"""Of a measure, relative: what differences over a step leave where nothing changes. A Polydyne's jerk, three
derivatives of pieces of degree 11, has the larger one."""


def constructed(family: str, scene=KODAMA, **changes) -> Lift:
    """The member of a family from its own NumPy constructor."""
    if family == "free":
        return FREE.lift(changes["z"])
    record = family_named(family)
    assert record.design is not None
    keywords = {record.parameters[name].keyword: value for name, value in (GIVEN.get(family, {}) | changes).items()}
    return record.design(scene, **keywords)


def test_every_family_with_parameters_has_a_member_to_be_differentiated():
    parameters = {name: family_named(name).parameters for name in FAMILIES}
    assert {name for name, known in parameters.items() if {"sections_deg", "exponents"} & set(known)} == set(GIVEN)


def z_start() -> np.ndarray:
    return FREE.Z.T @ (-0.004 * np.cos(np.linspace(-3.2, 2.9, len(FREE.x_p))) - FREE.x_p)


def start(family: str) -> Lift:
    return constructed(family, z=z_start()) if family == "free" else constructed(family)


def moved(family: str, name: str, index: int | None, value: float) -> Lift:
    """The member with one parameter at a value; the last section takes the rest of half the duration."""
    if family == "free":
        z = z_start()
        z[index] = value
        return constructed(family, z=z)
    given = dict(GIVEN.get(family, {}))
    assert DESIGN is not None
    design = DESIGN.model_dump()
    if index is not None:
        listed = np.array(given[name], dtype=float)
        free = np.flatnonzero(listed >= 8) if name == "exponents" else np.arange(len(listed) - 1)
        listed[free[index]] = value
        given[name] = tuple(listed)
    elif name in design:
        design[name] = value
    else:
        given[name] = value
    if "sections_deg" in given:
        first = given["sections_deg"][:-1]
        given["sections_deg"] = (*first, design["duration_deg"] / 2 - sum(first))
    scene = KODAMA.model_copy(update={"design": type(DESIGN)(**design)})
    return constructed(family, scene, **given)


def measures(lift: Lift) -> dict[str, np.ndarray]:
    found = {"lift": lift(THETA), "area": np.array(lift.area)}
    return found | {f"peak {k} {low}": np.array(lift.extremes(k)[0 if low else 1]) for k, low in PEAKS}


def by_jax(cam) -> tuple[dict, dict]:
    """Jacobian of every measure by every parameter, and the measures, in one compilation."""

    def all_of(p):
        built, half = cam.moving_pieces(p), cam.half_duration(p)
        once = replace(cam, moving_pieces=lambda _: built, half_duration=lambda _: half)  # one construction to compile
        found = {"lift": once.lift(THETA, p), "area": once.area(p)}
        found |= {f"peak {k} {low}": once.peak(p, k, low) for k, low in PEAKS}
        by_angle = {f"derivative {k}": once.lift(THETA + 2 * np.pi, p, k) for k in range(4)}
        return found, found | by_angle

    return compiled(jax.jacfwd(all_of, has_aux=True))(cam.parameters)


def compiled(function):
    """The function without the compiler's long optimisations: it runs once."""
    options = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
    return jax.jit(function, compiler_options=options)


SHORT = {"polydyne", "multi-pol", "free"}
"""One of each construction; a family's programs take some seconds to compile, so the others are long."""


@pytest.mark.parametrize(
    "family", [pytest.param(f, marks=() if f in SHORT else pytest.mark.long) for f in [*FAMILIES, "free"]]
)
def test_against_central_differences(family):
    lift = start(family)
    cam = differentiable(KODAMA, lift)
    jacobian, values = by_jax(cam)
    for name, value in measures(lift).items():
        np.testing.assert_allclose(values[name], value, rtol=1e-9, atol=1e-15, err_msg=name)
    for order in range(4):  # round-off of an angle a turn further; at a step the two may take different sides
        inner = np.abs(THETA[:, None] - lift.borders).min(axis=1) > 1e-9
        expected, got = lift(THETA, order)[inner], values[f"derivative {order}"][inner]
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    for name, value in cam.parameters.items():
        for index in [None] if value.ndim == 0 else range(len(value)):
            at = float(value if index is None else value[index])
            step = STEP * (abs(at) if name != "z" else 0.004)
            runs = [measures(moved(family, name, index, at + k * step)) for k in (-2, -1, 1, 2)]
            for measure, scale in measures(lift).items():
                a, b, c, d = (run[measure] for run in runs)
                expected = (8 * (c - b) - (d - a)) / (12 * step)
                got = np.asarray(jacobian[measure][name])
                got = got if index is None else got[..., index]
                noise = JERK_ROUND_OFF if "peak 3" in measure else ROUND_OFF
                round_off = noise * np.abs(scale).max() / step
                error = np.abs(got - expected).max()
                assert error <= 1e-6 * np.abs(expected).max() + round_off, (family, name, index, measure)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_parameter_of_the_command_line_is_one_to_differentiate_by(family):
    numeric = {name for name, p in family_named(family).parameters.items() if p.parse in (number, numbers)}
    found = differentiable(KODAMA, start(family)).parameters
    assert numeric - DETERMINED.get(family, set()) <= set(found)
    assert {"duration_deg", "max_lift_mm", "ramp_height_mm", "ramp_velocity_mm_per_deg"} <= set(found)


@pytest.mark.long
def test_reverse_mode_of_many_cams_at_once():
    cam = differentiable(KODAMA, start("trapezoid"))
    sections = cam.parameters["sections_deg"] + jnp.array([[0.0, 0.0, 0.0], [1.0, -0.5, 0.0]])

    def area(first):
        return cam.area(cam.parameters | {"sections_deg": first})

    values, gradients = compiled(jax.vmap(jax.value_and_grad(area)))(sections)

    def constructed_area(first):
        return constructed("trapezoid", sections_deg=(*first, 72 - sum(first))).area

    for first, value, gradient in zip(np.asarray(sections), values, gradients, strict=True):
        assert value == pytest.approx(constructed_area(first), rel=1e-12)
        for unit, slope in zip(np.eye(3) * 1e-3, gradient, strict=True):
            difference = (constructed_area(first + unit) - constructed_area(first - unit)) / 2e-3
            assert slope == pytest.approx(difference, rel=1e-6)


def test_a_lift_table_has_no_parameters():
    with pytest.raises(InputError, match=r"cam 'table' has no parameters .* take one of polydyne"):
        differentiable(KODAMA, Lift(np.array([-np.pi, np.pi]), np.zeros((1, 2)), 1.0, "table"))


class TestRiseFunctionsBetweenDwells:
    """Without a ramp: the peaks that handbooks print (Norton 2009, ch. 3)."""

    @pytest.mark.parametrize(
        ("family", "velocity", "acceleration", "jerk"),
        [
            ("cycloidal", 2.0, 2 * np.pi, 4 * np.pi**2),
            ("3-4-5", 1.875, 5.7735, 60.0),
            ("4-5-6-7", 2.1875, 7.5132, 52.5),
        ],
    )
    def test_peaks(self, family, velocity, acceleration, jerk):
        half, rise = 72 * DEG, 9.0 * MM
        one = opening_flank(TABLES[family], np.array([half]))
        x = close_flank(TABLES[family], one, np.zeros(3), rise, ("y_nose",))
        borders, coefficients = one.event(x)
        u = np.linspace(0.0, half, 2001)
        piece = np.searchsorted(borders, u - half, side="right") - 1
        piece = np.minimum(piece, len(one.pieces) - 1)
        local = u - half - borders[piece]
        for order, factor in ((1, velocity), (2, acceleration), (3, jerk)):
            values = [
                np.polynomial.Polynomial(coefficients[i]).deriv(order)(v) for i, v in zip(piece, local, strict=True)
            ]
            assert np.abs(values).max() * half**order / rise == pytest.approx(factor, rel=1e-4)

    @pytest.mark.parametrize("family", ["cycloidal", "3-4-5", "4-5-6-7"])
    def test_joins_the_ramp_and_rests_at_the_nose(self, family):
        lift = start(family)
        assert DESIGN is not None
        ramp = scene_ramps(DESIGN)[0]
        top = np.array([-72 * DEG * (1 - 1e-12), -1e-12])
        assert lift(top) == pytest.approx([ramp.height, 9.4 * MM], rel=1e-9)
        assert lift(top, 1) == pytest.approx([ramp.velocity, 0.0], rel=1e-8, abs=1e-9 * ramp.velocity)
        assert lift(top, 2) == pytest.approx([0.0, 0.0], abs=1e-9)
