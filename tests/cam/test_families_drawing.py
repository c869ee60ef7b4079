"""Sectioned families hold the limits of a drawing by their program; members that cannot are shown as breaking them."""

import numpy as np
import pytest

from camopt import multi_pol
from camopt.cam.geometry import smallest_radii
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.baselines.comparison import member_or_sentence
from camopt.scene import InputError
from camopt.scene.design import Piston
from camopt.scene.geometry import Geometry
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, with_design

FLAT = Geometry(follower="flat", base_radius_mm=24.0)
SECTIONS = (10, 7, 7, 27, 21)
PISTON = Piston(stroke_mm=86.0, rod_mm=143.0, gap_at_top_mm=2.8, clearance_mm=1.0, lobe_centre_deg=108.0)
GRID = np.arange(-72.0, 72.0005, 0.001) * DEG


def scene_with(geometry=FLAT, **limits):
    return with_design(geometry, max_lift_mm=8.0, **limits)


def radius_mm(lift):
    return 24.0 + float((lift(GRID) + lift(GRID, 2)).min()) / MM


def face_mm(lift):
    return 2 * float(np.abs(lift(GRID, 1)).max()) / MM


LIMITS = {
    "nose_radius_min_mm": ({"nose_radius_min_mm": 4.8}, radius_mm, 4.8, np.inf),
    "face_width_mm": ({"geometry": FLAT.model_copy(update={"face_width_mm": 24.5})}, face_mm, 0.0, 24.5),
    "lift_at": ({"lift_at": ((-50.0, 0.0, 2.65),)}, lambda lift: float(lift(-50 * DEG)) / MM, 0.0, 2.65),
}


@pytest.mark.parametrize("key", LIMITS)
def test_a_member_without_the_limit_breaks_it_and_one_with_it_holds_it_at_every_angle(key):
    limit, value, least, most = LIMITS[key]
    free, held = multi_pol(scene_with(), SECTIONS), multi_pol(scene_with(**limit), SECTIONS)
    design = scene_with(**limit).design
    assert broken_by_shape(free, design) == [key]
    assert not least <= value(free) <= most
    assert broken_by_shape(held, design) == []
    assert least <= value(held) <= most
    assert held.area < free.area


def test_the_pistons_clearance_is_held_on_the_flank_that_faces_it():
    tight = PISTON.model_copy(update={"gap_at_top_mm": 2.5})
    scene, tighter = scene_with(piston=PISTON), scene_with(piston=tight)
    assert broken_by_shape(multi_pol(scene_with(), SECTIONS), tighter.design) == ["piston"]
    assert broken_by_shape(multi_pol(scene, SECTIONS), scene.design) == []


def test_a_family_that_cannot_hold_a_limit_says_so_and_polydyne_is_named_as_breaking_it():
    scene = scene_with(nose_radius_min_mm=20.0)
    with pytest.raises(InputError, match="those of the drawing"):
        multi_pol(scene, SECTIONS)
    said = member_or_sentence(scene, "polydyne")
    assert isinstance(said, str)
    assert "nose_radius_min_mm" in said


FINGER = KODAMA.geometry


@pytest.mark.parametrize("limit", [{"snap_max_mm_per_deg4": 5e-4}, {"waves_max": 3}, {"nose_radius_min_mm": 11.0}])
def test_a_limit_that_a_familys_search_does_not_hold_is_named_as_broken(limit):
    """Snap, waves, radii under a finger: the member is that without the limit, and is no baseline beyond 10 %."""
    scene, (key,) = scene_with(FINGER, **limit), limit
    member = multi_pol(scene, SECTIONS)
    assert member.coefficients == pytest.approx(multi_pol(scene_with(FINGER), SECTIONS).coefficients)
    assert broken_by_shape(member, scene.design) == [key]
    said = member_or_sentence(scene, f"multi-pol:sections_deg={'/'.join(map(str, SECTIONS))}")
    assert isinstance(said, str) and f"its member breaks {key} by up to" in said
    assert said.startswith("multi-pol: no cam to compare with")


def test_a_member_that_nearly_holds_a_radius_is_compared_and_named_as_breaking_it():
    scene = scene_with(FINGER)
    reached = smallest_radii(multi_pol(scene, SECTIONS), FINGER)[0] / MM
    asked = scene_with(FINGER, nose_radius_min_mm=1.02 * reached)
    member = member_or_sentence(asked, f"multi-pol:sections_deg={'/'.join(map(str, SECTIONS))}")
    assert not isinstance(member, str)
    assert broken_by_shape(member, asked.design) == ["nose_radius_min_mm"]
