"""Paths of tied contacts and their derivatives: the two sources against each other, and against DOP853."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import camopt
from camopt.cam.families.free import free_cam
from camopt.measure.as_built import trains_as_built
from camopt.scene import InputError, build_train
from camopt.scene.load import parse_scene
from camopt.scene.rest import rest_position
from camopt.scene.train import GROUND
from camopt.scene.toml_text import scene_toml
from camopt.scene.units import MM, UM

KNOT = 6.0
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
    adjuster has leaked is held by the closed response: 2 per cent.
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
                assert relative(mine[s][event], its[s][event]) < (0.02 if oil else 2e-3), variable
        assert np.all(smooth.moved_um < 1e-3)


def test_derivatives_by_numbers_agree():
    """As above, where no contact hops. How soon lash and seat change hangs on these numbers, and the closed response
    holds these angles: on the closing flank nothing is left of what rings from there."""
    scene = camopt.load_scene("motori-1")
    cam, names = calm(scene), ("spring.stiffness_N_per_m", "valve.mass_kg", "train.gap_mm", "design.ramp_height_mm")
    smooth, exact = (
        camopt.linearised(scene, cam, (1500, 5000), free=names, source=source) for source in ("smooth", "exact")
    )
    closing = in_event(exact, scene, 0.0)
    assert list(smooth.number.values) == list(names)
    assert smooth.number_value.values == pytest.approx([38200.0, 0.24, 0.1, 0.265])
    for variable in ("contact_force_N_by_number", "gap_mm_by_number", "seat_gap_mm_by_number"):
        mine, its = smooth[variable].values[:, closing], exact[variable].values[:, closing]
        for s in range(2):
            for k in range(len(names)):
                assert relative(mine[s, ..., k], its[s, ..., k]) < 1e-3, (variable, names[k])
