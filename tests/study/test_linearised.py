"""Paths of tied contacts and their derivatives: the two sources against each other, and against DOP853."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import camopt
from camopt.cam.families.free import free_cam
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.free_numbers import free_number
from camopt.scene import InputError, build_train
from camopt.scene.load import parse_scene
from camopt.scene.rest import rest_position
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM, UM

KNOT, SPEEDS = 6.0, (1000.0, 5000.0)
STRAIGHT = ["motori-1", *(pytest.param(n, marks=pytest.mark.long) for n in
            ("motori-2", "exhaust-gas", "kodama", "pushrod-5mass", "pushrod-hydraulic"))]  # fmt: skip
"""The built-in scenes of straight laws without friction, with a [design]."""


def calm(scene, knot_deg=KNOT):
    free = free_cam(scene.design, knot_deg)
    return free.lift(np.zeros(free.Z.shape[1]))


def in_event(found, scene, first=None):
    """Whether angles are within the event, from `first` [deg] on, by default 2 degrees behind the ramp top."""
    half, theta = scene.design.duration_deg / 2, found.cam_angle_deg.values
    return (theta > (2.0 - half if first is None else first)) & (theta < half - 1e-9)


def largest(a, b) -> float:
    return float(np.abs(a - b).max())


def relative(a, b) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b))


@pytest.mark.parametrize("name", STRAIGHT)
def test_the_sources_agree(name):
    """At a fifth of the band's lowest speed no contact hops on its ramp, and the forces differ by what the layer moves
    the touch of lash and seat: a newton for each micrometre of width, and what the steps leave. Where a train is not
    linear the closed response also takes its forces as constant between two samples of the event-exact motion: 2 N.

    At the band's own speed contacts hop on the opening ramp, where the closed response holds them; what rings of that
    has died away to 1.5 N on the closing flank. The slopes do not hang on it where the train is linear. How far an
    adjuster has leaked is held by the closed response, which is what its slopes miss: 5 per cent at most, where those
    of the smoothed motion are its own differences (below).
    """
    scene = camopt.load_scene(name)
    cam, band = calm(scene), scene.operation.band_rpm[0]
    speeds = (0.2 * band, band)
    exact = camopt.linearised(scene, cam, speeds, source="exact")
    linear, oil = build_train(scene).laws is None and not build_train(scene).forcing, bool(build_train(scene).memory)
    event, closing = in_event(exact, scene), in_event(exact, scene, 0.0)
    for width in (1.0, 0.1):
        smooth = camopt.linearised(scene, cam, speeds, width_um=width)
        force, theirs = smooth.contact_force_N.values, exact.contact_force_N.values
        assert largest(force[0, event], theirs[0, event]) < 0.1 + width + (0.0 if linear else 2.0)
        assert largest(force[1, closing], theirs[1, closing]) < 1.5
        seat = largest(smooth.seat_gap_mm.values[0, event], exact.seat_gap_mm.values[0, event])
        assert seat < 1e-3 * (width + 0.1)  # mm: the layer's own width
        for variable in ("contact_force_N_by_z", "gap_mm_by_z", "seat_gap_mm_by_z"):
            mine, its = smooth[variable].values, exact[variable].values
            for s in range(2):
                assert relative(mine[s][event], its[s][event]) < (0.05 if oil else 2e-3), variable
        assert np.all(smooth.moved_um < 1e-3)


def test_derivatives_by_numbers_agree():
    """In the whole event where no contact hops; at the band's speed where what rings of hops has died away. How soon
    lash and seat change hangs on these numbers, and the closed response holds these angles."""
    scene = camopt.load_scene("motori-1")
    cam, names = calm(scene), ("spring.stiffness_N_per_m", "valve.mass_kg", "train.gap_mm", "design.ramp_height_mm")
    smooth, exact = (camopt.linearised(scene, cam, SPEEDS, free=names, source=source) for source in ("smooth", "exact"))
    assert list(smooth.number.values) == list(names)
    assert smooth.number_value.values == pytest.approx([38200.0, 0.24, 0.1, 0.265])
    for s, where in enumerate((in_event(exact, scene), in_event(exact, scene, 30.0))):
        for variable in ("contact_force_N_by_number", "gap_mm_by_number", "seat_gap_mm_by_number"):
            mine, its = smooth[variable].values[s][where], exact[variable].values[s][where]
            for k, name in enumerate(names):
                assert relative(mine[..., k], its[..., k]) < 1e-3, (variable, name)


def test_drawn_trains_are_those_of_the_tolerances():
    """Cam and numbers: without grinding errors each is as the drawn scene is by itself, and with them they differ."""
    scene = camopt.load_scene("motori-1")
    smooth_cams = scene.model_copy(update={"grinding": None})
    cam, speeds = calm(scene), SPEEDS
    found = camopt.linearised(scene, cam, speeds, trains=2, seed=5)
    assert found.sizes["train"] == 2
    plain = camopt.linearised(smooth_cams, cam, speeds, trains=2, seed=5)
    for i, one in enumerate(trains_as_built(smooth_cams, 2, seed=5)):
        alone = camopt.linearised(one.scene, cam, speeds)
        assert largest(plain.contact_force_N.values[i], alone.contact_force_N.values) < 1e-6
        assert largest(found.contact_force_N.values[i], alone.contact_force_N.values) > 5.0
    exact = camopt.linearised(scene, cam, speeds, trains=2, seed=5, source="exact")
    event = in_event(found, scene)
    assert largest(found.contact_force_N.values[:, 0, event], exact.contact_force_N.values[:, 0, event]) < 1.1


def test_a_small_step_is_foretold_and_labels_are_the_scenes():
    scene = camopt.load_scene("motori-1")
    cam = calm(scene)
    free = free_cam(scene.design, KNOT)
    about = camopt.linearised(scene, cam, SPEEDS)
    sizes = {"speed_rpm": 2, "cam_angle_deg": 1440, "contact": 1, "coefficient": free.Z.shape[1], "number": 0}
    assert about.sizes == sizes
    assert list(about.contact.values) == ["train"] and about.contact_force_N.attrs["units"] == "N"
    assert about.cam_angle_deg.values[[0, -1]] == pytest.approx([-179.75, 180.0])
    step = 2e-4 * np.random.default_rng(1).normal(size=free.Z.shape[1])
    after = camopt.linearised(scene, free.lift(step), SPEEDS)
    assert after.z.values == pytest.approx(step, abs=1e-12)
    closing = in_event(about, scene, 0.0)
    foretold = (about.contact_force_N + about.contact_force_N_by_z @ after.z).values[:, closing]
    change = after.contact_force_N.values[:, closing] - about.contact_force_N.values[:, closing]
    assert np.abs(change).max() > 5.0
    assert largest(after.contact_force_N.values[:, closing], foretold) < 1e-3 * np.abs(change).max()


def ramp(r):
    """The compact ramp and its slope: a quartic across |r| < 1/2."""
    z = np.clip(r + 0.5, 0.0, 1.0)
    return np.where(r < 0.5, z**3 * (1.0 - 0.5 * z), r), z * z * (3.0 - 2.0 * z)


class TiedMotion:
    """The tied law in plain NumPy, for trains without memories, integrated by DOP853 between the ramp tops."""

    PULLS_BELOW = 20.0  # N, of a curved law: the same as the package's own

    def __init__(self, train, lift, speed, tie, width):
        self.train, self.lift, self.speed, self.tie, self.width = train, lift, speed, tie, width
        self.on, self.touch = list(train.cam_side), train.touch_compression
        margin = train.compression(rest_position(train), 0.0) - self.touch
        closed = margin[self.on] >= -1e-12
        self.always = closed & ~closed.all()
        nodes = np.vstack([np.eye(len(train.mass)), np.zeros(len(train.mass))])  # the last, -1, is the ground
        self.incidence = nodes[train.a] - nodes[train.b]
        self.begin = np.zeros(len(self.on))
        if train.laws is not None:
            self.begin = np.array([brentq(lambda u, e=e: self.law(e, u)[0] - self.PULLS_BELOW, 0, 1e-2, xtol=1e-16)
                                   for e in self.on])  # fmt: skip

    def law(self, e, u):
        """Elastic force and stiffness of element e at a compression beyond its touch."""
        if self.train.laws is None:
            return self.train.stiffness[e] * u, self.train.stiffness[e]
        force, slope = self.train.laws.along(e, np.array([u + self.touch[e]]), self.train.preload[e])
        return force[0], slope[0]

    def forces(self, theta, x, v, share):
        """Every element's force, and the compressions beyond the touch."""
        t = self.train
        lift, slope = float(self.lift(theta)), float(self.lift(theta, 1))
        u = self.incidence @ x + t.cam_driven * lift - t.gap - self.touch
        u_dt = self.incidence @ v + t.cam_driven * slope * self.speed
        value, slope = ramp(u / self.width)
        force = np.empty(len(u))
        for e in range(len(u)):
            if t.contact[e]:
                force[e] = max(0.0, self.law(e, self.width * value[e])[0] + t.damping[e] * u_dt[e] * slope[e])
            else:
                force[e] = self.law(e, u[e])[0] + t.damping[e] * u_dt[e]
        for c, e in enumerate(self.on):
            straight_on = self.law(e, self.begin[c])[1] * min(u[e] - self.begin[c], 0.0)
            pull = self.law(e, max(u[e], self.begin[c]))[0] + straight_on + t.damping[e] * u_dt[e]
            force[e] += share[c] * (pull - force[e])
        return force, u

    def revolution(self, y, angles):
        """The state after a revolution from y, and contact forces (k, c) and seat gaps (k) at the angles."""
        t, n, half, paths = self.train, len(self.train.mass), self.lift.half_duration, []
        tops = [-np.pi, -half, half, np.pi]
        for low, high in pairwise(tops):
            share = self.tie * (np.ones(len(self.on)) if low == -half else self.always)

            def rate(theta, y, share=share):
                force, _ = self.forces(theta, y[:n], y[n:], share)
                pushed = t.mass_force - t.mass_damping * y[n:] - self.incidence.T @ force
                return np.concatenate([y[n:], pushed / t.mass]) / self.speed

            at = angles[(angles >= low - 1e-9) & (angles < high - 1e-9)]
            done = solve_ivp(rate, (low, high), y, "DOP853", np.append(np.clip(at, low, high), high),
                             rtol=1e-10, atol=np.repeat([1e-13, 1e-9], n))  # fmt: skip
            for theta, state in zip(at, done.y.T, strict=False):
                force, u = self.forces(theta, state[:n], state[n:], share)
                paths.append(np.append(force[self.on], -u[t.seat]))
            y = done.y[:, -1]
        return y, np.array(paths)

    def settled(self, angles, turns, y=None):
        """The state and the paths after so many revolutions from y, or from rest."""
        rest = rest_position(self.train)
        y = np.concatenate([rest, np.zeros_like(rest)]) if y is None else y
        for _ in range(turns):
            y, paths = self.revolution(y, angles)
        return y, paths


def hertz_motori():
    """`motori-1` whose contact at the cam is a Hertz contact that is as stiff at 1 kN."""
    scene = camopt.load_scene("motori-1")
    first, *others = scene.element
    update = {"law": "hertz", "exponent": 1.5, "stiffness_N_per_m": 3.2e10}
    text = scene_toml(scene.model_copy(update={"element": (first.model_copy(update=update), *others)}))
    return parse_scene(text, "hertz motori-1", ("design",))


@pytest.mark.parametrize(
    ("scene", "speed", "name", "turns"),
    [
        (hertz_motori, 3000.0, "train.stiffness_N_per_m", 1),
        pytest.param("race-nested", 6000.0, "outer_coil_1.preload_N", 6, marks=pytest.mark.long),
        pytest.param("kodama-hertz", 3000.0, "follower_valve.gap_mm", 6, marks=pytest.mark.long),
    ],
)
def test_curved_laws_against_dop853(scene, speed, name, turns):
    """Values, and slopes against central differences of the settled motion by DOP853 with the same tied law.

    The steps of a quarter of a degree run over the layer and its edges without regard to them: a newton or two of some
    hundreds, and one per cent of the slopes. A contact's own stiffness moves the mode that steps follow least well,
    and a gap the angle at which the lash closes: three per cent.
    """
    scene = camopt.load_scene(scene) if isinstance(scene, str) else scene()
    free, tie, width = free_cam(scene.design, KNOT), 0.7, 1.0
    m = free.Z.shape[1]
    found = camopt.linearised(scene, free.lift(np.zeros(m)), (speed,), tie=tie, width_um=width, free=name)
    theta = np.deg2rad(found.cam_angle_deg.values)[:-1]
    event = in_event(found, scene)[:-1]

    def truth(scene, z, turns, start=None):
        motion = TiedMotion(build_train(scene), free.lift(z), scene.cam_speed(speed), tie, width * UM)
        end, paths = motion.settled(theta, turns, start)
        return end, np.concatenate([paths[event, :-1], paths[event, -1:] / MM], axis=1)

    def difference(step, *sides):
        above, below = (truth(*side, 1 + turns // 3, end)[1] for side in sides)
        return (above - below) / (2 * step)

    def taken(suffix, direction):
        force, seat = (found[name + suffix].values[0, :-1][event] @ direction if suffix else
                       found[name].values[0, :-1][event] for name in ("contact_force_N", "seat_gap_mm"))  # fmt: skip
        return np.concatenate([force, seat[:, None]], axis=1)

    z = np.zeros(m)
    end, own = truth(scene, z, turns)
    assert largest(taken("", None)[:, :-1], own[:, :-1]) < 2.0
    assert largest(taken("", None)[:, -1], own[:, -1]) < 1e-3
    direction = np.random.default_rng(3).normal(size=m)
    by_z = difference(1e-5, (scene, 1e-5 * direction), (scene, -1e-5 * direction))
    number = free_number(scene, name)
    value, step = number.of(scene), 1e-4 * number.of(scene)
    by_number = difference(step, (number.put(scene, value + step), z), (number.put(scene, value - step), z))
    for column in range(own.shape[1]):
        assert relative(taken("_by_z", direction)[:, column], by_z[:, column]) < 0.01
        assert relative(taken("_by_number", np.ones(1))[:, column], by_number[:, column]) < 0.03


@pytest.mark.long
@pytest.mark.parametrize(("name", "most"), [("finger-hydraulic", 0.02), ("pushrod-hydraulic", 1e-3)])
def test_slopes_of_trains_with_memories_are_those_of_their_own_differences(name, most):
    """Oil that leaks and friction that sticks are in no closed response. At a step of 1e-5 mm/deg^2 the differences of
    friction, which turns at other angles then, leave a per cent."""
    scene = camopt.load_scene(name)
    free, speeds = free_cam(scene.design, KNOT), (0.6 * scene.operation.band_rpm[0],)
    direction = np.random.default_rng(0).normal(size=free.Z.shape[1])
    direction /= np.linalg.norm(direction)
    about, above, below = (camopt.linearised(scene, free.lift(s * 1e-5 * direction), speeds) for s in (0, 1, -1))
    event = in_event(about, scene)
    for variable in ("contact_force_N", "gap_mm", "seat_gap_mm"):
        slope = about[f"{variable}_by_z"].values @ direction
        difference = (above[variable] - below[variable]).values / 2e-5
        assert relative(slope[:, event], difference[:, event]) < most, variable


def with_limit(scene, **limit):
    return scene.model_copy(update={"design": scene.design.model_copy(update=limit)})


MOTOR = camopt.load_scene("motori-1")
SPEEDS_NEEDED = "expected crankshaft speeds above 0 r/min"
OTHER_CAM = "has not the duration and ramps of scene motori-1"


@pytest.mark.parametrize(
    ("name", "cam", "asked", "says"),
    [
        ("motori-1", calm(MOTOR), {"source": "best"}, "source 'best': expected one of smooth, exact"),
        ("motori-1", calm(MOTOR), {"speeds_rpm": ("fast",)}, SPEEDS_NEEDED),
        ("motori-1", calm(MOTOR), {"speeds_rpm": 6000}, SPEEDS_NEEDED),
        ("motori-1", calm(MOTOR), {"speeds_rpm": (np.nan,)}, SPEEDS_NEEDED),
        ("motori-1", calm(MOTOR), {"speeds_rpm": ()}, SPEEDS_NEEDED),
        ("motori-1", calm(MOTOR), {"width_um": 0.0}, "width_um 0.0: expected a width"),
        ("motori-1", calm(MOTOR), {"width_um": "wide"}, "width_um 'wide': expected a width"),
        ("motori-1", calm(MOTOR), {"tie": 1.5}, "tie 1.5: expected a share from 0 to 1"),
        ("motori-1", calm(MOTOR), {"tie": 0.5, "source": "exact"}, "tie 0.5 with source 'exact'"),
        ("motori-1", calm(MOTOR), {"trains": -1}, "trains -1 of seed 0: expected integers"),
        ("motori-1", calm(MOTOR), {"free": ("spring.stifness_N_per_m",)}, "has no such number"),
        ("motori-1", calm(MOTOR), {"free": "springs"}, "free 'springs'"),
        ("motori-1", camopt.polydyne(MOTOR), {}, "family 'polydyne': take the nearest free one by camopt"),
        ("motori-1", calm(with_limit(MOTOR, duration_deg=160.0)), {}, OTHER_CAM),
        ("motori-1", calm(with_limit(MOTOR, ramp_height_mm=0.3)), {}, OTHER_CAM),
        ("ohv-3dof", calm(MOTOR), {}, r"linearised needs valve, seat, \[operation\] and \[design\]"),
        ("kodama-hertz", None, {"source": "exact"}, "cam_follower, follower_valve; ask for source='smooth'"),
        ("finger-hydraulic", None, {"source": "exact"}, "holds the place where friction sticks"),
        ("exhaust-gas", None, {"source": "exact", "free": "spring.preload_N"}, "laws are all linear"),
    ],
)
def test_what_cannot_be_asked_for_is_one_sentence(name, cam, asked, says):
    scene = camopt.load_scene(name)
    with pytest.raises(InputError, match=says) as caught:
        camopt.linearised(scene, calm(scene) if cam is None else cam, **asked)
    assert "\n" not in str(caught.value)
