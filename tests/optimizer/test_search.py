"""The search on paths: its feedback, its two sources, its starts, and what it refuses."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from camopt import load_scene, optimize, polydyne
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.program.phases import force_unit
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search import search as module
from camopt.optimizer.search.cams import APART, BETWEEN_SHARE, USES_LESS, Search
from camopt.optimizer.search.margins import AIM, FIRST_STEP_N, IDLE, IDLE_ROUNDS, LARGEST_N, LEAST_STEP_N, Feedback
from camopt.optimizer.search.region import first_region, largest_acceleration
from camopt.optimizer.search.search import FLOWN, _between, find_cam
from camopt.scene.load import builtin_scenes
from camopt.scene.train import build_train

EFFORT = replace(ACCURACIES["draft"], knot_deg=6.0, feedback_rounds=6)


def test_a_margin_rises_where_more_than_the_aim_is_used_and_falls_where_less():
    fed = Feedback(np.zeros((3, 2)), 1.0)
    fed.update(np.array([[2 * AIM, 0.0], [AIM, AIM], [0.5 * AIM, AIM]]))
    assert fed.margins == pytest.approx(FIRST_STEP_N * np.array([[1.0, -1.0], [0.0, 0.0], [-0.5, 0.0]]))


def test_a_step_is_halved_where_its_sign_changes_and_tension_has_an_end():
    fed = Feedback(np.zeros((3, 1)), 1.0)
    for used in (0.0, 2.0, 0.0, 2.0, 0.0, 2.0):
        fed.update(np.full((3, 1), used))
    assert fed.step == pytest.approx(np.full((3, 1), LEAST_STEP_N), abs=0.5)
    for _ in range(300):
        fed.update(np.zeros((3, 1)))
    assert fed.margins.min() == -LARGEST_N


def test_the_unit_of_the_margins_doubles_while_motions_are_far_from_every_limit():
    fed, far = Feedback(np.zeros((3, 2)), 1.0), np.array([[0.0, 0.9 * IDLE], [0.0, 0.0], [0.0, 0.0]])
    grown = [fed.update(far) for _ in range(5)]
    assert grown == [False, False, False, True, True] and fed.unit == 4.0
    assert fed.margins[0, 0] == pytest.approx(-FIRST_STEP_N * (1 + 1 + 1 + 2 + 4))
    assert not fed.update(np.where(far > 0, 1.1 * IDLE, 0.0))
    assert [fed.update(far) for _ in range(4)] == [False, False, False, True]
    for _ in range(300):
        fed.update(far)
    assert fed.unit == 8.0 * 2 ** (len(IDLE_ROUNDS) - 1) and fed.margins.min() == -LARGEST_N * fed.unit


def test_margins_go_half_way_back_and_step_less():
    fed = Feedback(np.array([[-30.0], [10.0], [0.0]]), 1.0)
    fed.go_back(np.array([[10.0], [0.0], [0.0]]))
    assert fed.margins.ravel() == pytest.approx([-10.0, 5.0, 0.0])
    assert fed.step == pytest.approx(np.full((3, 1), FIRST_STEP_N / 2))


def test_margins_of_other_speeds_do_not_run_away_while_the_motion_flies_off():
    """On this train every cam's motion at the top speed breaks its limits as margins at lower speeds fall."""
    lines = []
    find_cam(load_scene("exhaust-gas"), "band", EFFORT, show=lines.append)
    fed_back = [line for line in lines if line["stage"] == "margins fed back"]
    assert sum(line["worst_share"] > FLOWN for line in fed_back) <= len(fed_back) / 2


class Fills:
    """A source of rows of cams with one coefficient: the valve of a larger one than `most` does not seat."""

    def __init__(self, most):
        self.most, self.at = most, None

    def errors_at(self, program, z):
        return np.array([np.inf if z[0] > self.most else 0.0])

    def about(self, program, z):
        self.at = z[0]
        return "about"


@pytest.mark.parametrize(("most", "centre"), [(0.6, 0.5), (0.3, 0.25), (0.2, 0.125)])
def test_the_next_centre_lies_before_a_cam_whose_valve_does_not_seat(most, centre):
    source = Fills(most)
    assert _between(source, "before", np.array([0.0]), np.array([1.0])) == ("about", [centre])
    assert source.at == centre


def test_the_centre_stays_where_no_cam_on_the_way_seats():
    assert _between(Fills(0.0), "before", np.array([0.0]), np.array([1.0])) == ("before", [0.0])


class Seats:
    """A search whose cams, one after the other, seat or do not; none of them holds."""

    def __init__(self, seats):
        self.seats, self.seen, self.steps, self.best, self.first = seats, [], 0, None, None

    def evaluate(self, stage, free, z, area_ratio):
        self.seen.append(SimpleNamespace(seats=self.seats[self.steps], judged=SimpleNamespace(used=2.0), lift=None))
        self.steps += 1
        return self.seen[-1]


@pytest.mark.parametrize(
    ("seats", "centres"), [((True, False, True), [0.0, 1.0, 1.25]), ((False, True, False), [0.0, 1.0, 2.0])]
)
def test_a_cam_whose_valve_does_not_seat_is_a_centre_only_before_others_seat(monkeypatch, seats, centres):
    scene, met = load_scene("motori-1"), []
    train, cam = build_train(scene), program_cam(scene.design, 6.0)
    program = module.without_rows(train, scene.design, cam, [scene.cam_speed(5000.0)])

    def solve_step(source, program, z, region, margins, of_speeds):
        met.append(z[0])
        return SimpleNamespace(program=program, z=z + 1.0, area_ratio=1e3, margins=margins)

    monkeypatch.setattr(module, "MOST_FIRST", len(seats))
    monkeypatch.setattr(module, "solve_step", solve_step)
    monkeypatch.setattr(module, "used_by_kind", lambda *of: np.zeros((3, 1)))
    monkeypatch.setattr(module, "_between", lambda source, program, z, beyond: (program, z + 0.25 * (beyond - z)))
    source = SimpleNamespace(about=lambda program, z: program)
    module._solve_programs(Seats(seats), source, program, np.zeros(cam.Z.shape[1]), 0)
    assert met == centres


@pytest.fixture(scope="module")
def found():
    scene = load_scene("motori-1")
    starts = {"calmest": None, "polydyne": polydyne(scene)}
    found = {name: find_cam(scene, "nominal", EFFORT, "smooth", start=start) for name, start in starts.items()}
    return found | {"exact": find_cam(scene, "nominal", EFFORT, "exact")}


def test_every_start_and_both_sources_lead_to_the_same_area(found):
    areas = [search.confirmed[-1].area_ratio for search in found.values()]
    assert max(areas) - min(areas) < 1e-3  # what issue 35 asks of starts


def test_the_first_stage_alone_has_less_area(found):
    first = find_cam(load_scene("motori-1"), "nominal", EFFORT, "none")
    assert first.steps < found["exact"].steps
    assert first.confirmed[-1].area_ratio < found["exact"].confirmed[-1].area_ratio


def test_confirmed_cams_grow_and_the_smaller_ones_use_less_or_differ_in_area(found):
    for search in found.values():
        areas = [cam.area_ratio for cam in search.confirmed]
        assert areas == sorted(areas)
        for smaller, larger in pairwise(search.confirmed):
            uses_less = smaller.judged.used < larger.judged.used - USES_LESS
            assert uses_less or larger.area_ratio - smaller.area_ratio >= APART


def test_where_no_program_has_a_cam_that_holds_one_between_them_and_the_first_may(monkeypatch):
    def programs(search, source, program, z, rounds):
        far = program.solve_below(np.full((3, len(program.blocks)), -1e3))
        search.first = search.evaluate("path constraints", far.program.cam, far.z, far.area_ratio)

    monkeypatch.setattr(module, "_solve_programs", programs)
    search = find_cam(load_scene("motori-1"), "nominal", EFFORT, "exact")
    far, first = search.seen[:2]
    assert far.judged.used > 1.0 and first.judged.used <= BETWEEN_SHARE
    assert first.area_ratio < search.confirmed[-1].area_ratio < far.area_ratio


def tried(area_ratio, used, share=None, **further):
    share = np.array([used if share is None else share])
    return SimpleNamespace(area_ratio=area_ratio, judged=SimpleNamespace(used=used, share=share), **further)


def test_a_cam_that_holds_is_offered_although_a_larger_one_was_found_before_it():
    cams = (0.60, 0.85), (0.59, 0.5), (0.58, 0.49), (0.61, 1.2), (0.57, 0.4), (0.55, 0.3), (0.54, 0.2)
    largest, unlike, alike, broken, small, smaller, smallest = (tried(*cam) for cam in cams)
    search = Search(None, None, None, "calmest", seen=[largest, unlike, alike, broken, small, smaller, smallest])
    search.confirm()
    assert search.confirmed == [smaller, small, alike, unlike, largest]


def test_places_that_are_left_go_to_cams_that_differ_in_area():
    cams = [tried(area, 0.8) for area in (0.6, 0.5996, 0.599, 0.598)]
    search = Search(None, None, None, "calmest", seen=cams)
    search.confirm()
    assert [cam.area_ratio for cam in search.confirmed] == [0.598, 0.599, 0.6]


class Halfway(Search):
    """A search whose cams between others hold, or do not."""

    holds = True

    def evaluate(self, stage, free, z, area_ratio):
        assert free == "free" and area_ratio == pytest.approx(z)
        return tried(area_ratio, 0.5 if self.holds else 1.5, free=free, z=z)


def offered(cams, holds, none_holds=False):
    seen = [tried(area, used, share, free="free", z=area) for area, used, share in cams]
    search = Halfway(None, None, None, None, "calmest", seen=seen)
    search.holds = holds
    search.confirm(none_holds)
    return [cam.area_ratio for cam in search.confirmed]


def test_places_that_are_left_go_to_cams_between_those_that_differ_much():
    cams = [(0.52, 0.8, 0.8), (0.6, 0.8, 0.8)]
    assert offered(cams, holds=True) == pytest.approx([0.52, 0.56, 0.58, 0.59, 0.6])
    assert offered(cams, holds=False) == [0.52, 0.6]


def test_the_largest_cam_without_a_reserve_is_offered_where_none_of_the_programs_has_one():
    cams = [(0.6, 0.8, 0.8), (0.599, 0.8, 0.8), (0.62, 1.2, 0.95), (0.63, 1.2, 1.1)]
    assert offered(cams, holds=False, none_holds=True) == [0.599, 0.6, 0.62]
    assert offered(cams, holds=False) == [0.599, 0.6]
    assert offered(cams[:2], holds=False, none_holds=True) == [0.599, 0.6]


def test_slopes_are_kept_where_they_foretell_the_forces(found):
    assert found["calmest"].source.jacobians < found["calmest"].steps


def test_a_job_on_paths_is_confirmed_and_says_how_it_searched(undrawn, tmp_path):
    scene = load_scene("motori-1")
    run = optimize(scene, "nominal", "draft", "smooth", tmp_path / "run", compare=False, start=polydyne(scene))
    assert run.exit_code == 0
    assert run.record["search"].items() >= {"source": "smooth", "start": "polydyne"}.items()
    assert run.record["search"]["jacobians"] >= 1


def in_other_forces(scene, factor):
    """The scene with all masses, stiffnesses, dampings and forces times a factor: its motions are the same."""

    def scaled(part):
        names = (name for name in type(part).model_fields if name.endswith(("_kg", "_N", "_N_per_m", "_N_s_per_m")))
        values = {name: getattr(part, name) for name in names}
        return part.model_copy(update={n: factor * value for n, value in values.items() if value is not None})

    return scene.model_copy(update={key: tuple(map(scaled, getattr(scene, key))) for key in ("mass", "element")})


def test_a_train_of_other_forces_has_the_same_cam(found):
    """A hundredth of all forces, as of a small engine: margins, steps and costs of the search follow them."""
    scene = in_other_forces(load_scene("motori-1"), 0.01)
    assert force_unit(build_train(scene)) == 0.01
    for start, source in (("calmest", "smooth"), ("exact", "exact")):
        other = find_cam(scene, "nominal", EFFORT, source)
        assert other.confirmed[-1].area_ratio == pytest.approx(found[start].confirmed[-1].area_ratio, abs=1e-4)


def test_without_a_largest_acceleration_the_box_is_that_of_a_usual_one():
    """At the lift and duration of kodama this is nearly the scene's own limit, and it follows both."""
    given = load_scene("kodama").design
    design = given.model_copy(update={"acceleration_max_mm_per_deg2": None})
    assert largest_acceleration(given) == given.acceleration_max_mm_per_deg2
    assert first_region(design).width == pytest.approx(first_region(given).width, rel=0.01)
    wider = design.model_copy(update={"max_lift_mm": 3 * design.max_lift_mm, "duration_deg": 2 * design.duration_deg})
    assert first_region(wider).width == pytest.approx(0.75 * first_region(design).width)


def test_forces_of_the_built_in_trains_are_those_for_which_the_search_is_stated():
    scenes = [scene for scene in map(load_scene, builtin_scenes()) if scene.design]
    assert len(scenes) > 5 and {force_unit(build_train(scene)) for scene in scenes} == {1.0}
