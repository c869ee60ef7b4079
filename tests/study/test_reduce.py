"""Smaller models against the whole one: what they keep exactly, what they get wrong, and contacts that are left out."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli import parser as cli
from camopt.exact import engine
from camopt.measure.settling import settled_from_rest
from camopt.scene import InputError, MotionRefused, build_train, load_scene, parse_scene, rest_position, state_at_rest
from camopt.scene.element import Element
from camopt.scene.parameters import matching, with_numbers
from camopt.scene.text_file import scene_toml
from camopt.scene.vibration import assembled
from camopt.study.modes import modes
from camopt.study.reduce.idle_contacts import idle_contacts, leave_out
from camopt.study.reduce.reduced_models import chains, condense, fewer_coils, smaller_models
from camopt.study.reduce.reduction import reduce
from camopt.verifier.convergence import first_steps
from camopt.verifier.methods import rkg

KODAMA, MOTORI, PUSHROD = (load_scene(name) for name in ("kodama", "motori-1", "pushrod-5mass"))


def settled(scene, lift, speed_rpm=5000.0):
    return settled_from_rest(engine.prepare, build_train(scene), lift, scene.cam_speed(speed_rpm))


def test_all_surge_modes_are_the_same_motion_in_other_coordinates():
    """Tolerance: both motions bounce, and rounding grows a hundredfold at each of a dozen contacts."""
    lift = polydyne(KODAMA)
    modal = fewer_coils(KODAMA, chains(KODAMA), 5)
    assert len(modal.mass) == 10
    whole, same = settled(KODAMA, lift), settled(modal, lift)
    at = np.linspace(-np.pi, np.pi, 721)
    x, y = (np.interp(at, one.response.angle, one.response.seat_separation()) for one in (whole, same))
    # linear interpolation between other samples: 5e-7 m; a lost mode moves the valve by 6e-6 m
    np.testing.assert_allclose(x, y, atol=1e-6)
    for name in ("bounce_mm", "contact_force_max_N"):
        assert whole.metrics(lift).worst(name) == pytest.approx(same.metrics(lift).worst(name), rel=1e-4)


@pytest.mark.parametrize("scene", [KODAMA, PUSHROD], ids=lambda s: s.name)
def test_a_reduced_spring_keeps_rate_felt_mass_and_surge(scene):
    ((end, coils, springs),) = chains(scene)
    n = len(coils)
    for surge in range(n):
        small = fewer_coils(scene, [(end, coils, springs)], surge)
        masses, elements = ({one.name: one for one in rows} for rows in (small.mass, small.element))
        hung = [name for name in masses if name.startswith("surge")]
        assert len(masses) == len(scene.mass) - n + surge and len(hung) == surge
        # rate, rest, and damping in proportion to stiffness
        k, proportion = springs[0].stiffness_N_per_m, springs[0].damping_N_s_per_m / springs[0].stiffness_N_per_m
        assert elements["static_spring_1"].stiffness_N_per_m == pytest.approx(k / len(springs))
        positions = [rest_position(build_train(s))[[m.name for m in s.mass].index(end)] for s in (scene, small)]
        assert positions[0] == pytest.approx(positions[1], rel=1e-9)
        for name in ("static_spring_1", *hung):
            one = elements[name]
            assert one.damping_N_s_per_m == pytest.approx(proportion * one.stiffness_N_per_m, rel=1e-9)
        # mass felt at the valve's end: sum of m_i (1 - i / (n + 1))^2
        felt = sum(m.mass_kg * (1 - i / (n + 1)) ** 2 for i, m in enumerate(coils, 1))
        head = next(m.mass_kg for m in scene.mass if m.name == end)
        assert sum(masses[name].mass_kg for name in (end, *hung)) - head == pytest.approx(felt, rel=1e-9)
        # fixed-fixed surge of the uniform chain: 2 sqrt(k / m) sin(j pi / (2 n + 2))
        expected = 2 * np.sqrt(k / coils[0].mass_kg) * np.sin(np.arange(1, surge + 1) * np.pi / (2 * n + 2))
        found = [np.sqrt(elements[name].stiffness_N_per_m / masses[name].mass_kg) for name in hung]
        np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("mass", ["camshaft", "follower", "valve_stem"])
def test_condensing_keeps_the_static_answer(mass):
    """Rest and the stiffness felt by the other masses: the Schur complement of the assembled matrix."""
    train, i = build_train(KODAMA), [m.name for m in KODAMA.mass].index(mass)
    small = build_train(condense(KODAMA, mass))
    every = np.ones(len(train.a), dtype=bool)
    k, others = assembled(train, every)[1], np.arange(len(train.mass)) != i
    left = k[np.ix_(others, others)] - np.outer(k[others, i], k[i, others]) / k[i, i]
    np.testing.assert_allclose(assembled(small, every[1:])[1], left, rtol=1e-9, atol=1e-3)
    assert small.lash == pytest.approx(train.lash, abs=1e-15)
    x = rest_position(train)
    if mass != "follower":  # its force goes on with it, to the tip
        np.testing.assert_allclose(rest_position(small), x[others], rtol=1e-6, atol=1e-12)


def test_condensing_turns_a_preloaded_spring_and_the_valve():
    """The head condensed: the seat touches where the two in series do, and the tip's side becomes the valve."""
    stem = condense(KODAMA, "valve_stem")
    head = condense(stem, "valve_head")
    seat = next(e for e in head.element if e.name == "seat")
    assert (head.valve, seat.between) == ("valve_tip", ("ground", "valve_tip"))
    compliance = 1 / 80.1e6 + 1 / 142e6 + 1 / 72.3e6
    assert seat.stiffness_N_per_m == pytest.approx(1 / compliance)
    # the seat lets go where it did: 197 N / (72.3e6 N/m) above the installed position
    assert seat.preload_N == pytest.approx(197 / 72.3e6 / compliance)
    assert sum(m.mass_kg for m in head.mass) == pytest.approx(sum(m.mass_kg for m in KODAMA.mass))


def test_a_mass_between_many_elements_is_not_condensed():
    with pytest.raises(InputError, match=r"valve_tip.*series"):
        condense(KODAMA, "valve_tip")


@pytest.mark.parametrize("scene", [KODAMA, PUSHROD, load_scene("kodama-hertz")], ids=lambda s: s.name)
def test_every_model_is_a_scene_that_reads_back(scene):
    models = smaller_models(scene)
    counts = [len(m.scene.mass) for m in models]
    assert models[0].scene is scene
    assert len({m.scene.name for m in models}) == len(models)
    assert set(counts) == set(range(min(counts), len(scene.mass) + 1))
    assert min(counts) == (3 if scene.name == "kodama-hertz" else 1)
    for m in models:
        assert parse_scene(scene_toml(m.scene), "text") == m.scene
    lowest = [modes(m.scene).frequency_Hz[0] for m in models if m.surge_masses]
    np.testing.assert_allclose(lowest, lowest[0], rtol=0.01)  # the first surge stands in every model that has one


def test_coils_that_may_clash_are_kept():
    clash = Element(name="clash", kind="contact", between=("spring_1", "spring_2"), stiffness_N_per_m=1e6, gap_mm=6.0)
    scene = KODAMA.model_copy(update={"element": (clash, *KODAMA.element)})
    ((end, coils, _),) = chains(scene)  # what hangs below them may still be reduced
    assert (end, [m.name for m in coils]) == ("spring_2", ["spring_3", "spring_4", "spring_5"])
    assert all({"spring_1", "spring_2"} <= {m.name for m in s.scene.mass} for s in smaller_models(scene))
    assert chains(scene, frozenset({"spring_5"})) == []


class TestLeftOut:
    LIFT, SPEED = polydyne(MOTORI), MOTORI.cam_speed(5000)
    CLASH, SPRING = frozenset({"coil_clash"}), frozenset({"spring"})

    def revolution(self, scene):
        """A revolution of a scene from rest."""
        train = build_train(scene)
        return engine.prepare(train, self.LIFT, self.SPEED)(state_at_rest(train))

    def test_idle_contacts_of_motori(self):
        assert idle_contacts([settled(MOTORI, self.LIFT).response]) == (self.CLASH, self.SPRING)

    def test_without_them_no_digit_changes(self):
        """At equal steps: fixed-step methods do the same arithmetic on what acts."""
        model = leave_out(MOTORI, self.CLASH, self.SPRING)
        whole, part = build_train(MOTORI), build_train(model.scene)
        assert (whole.contact.sum(), part.contact.sum()) == (4, 2)
        a = rkg.prepare(whole, self.LIFT, self.SPEED, 20_000)(state_at_rest(whole))
        b = model.prepare(rkg.prepare, part, self.LIFT, self.SPEED, 20_000)(state_at_rest(part))
        assert np.array_equal(a.x, b.x)
        assert np.array_equal(a.v, b.v)

    def test_a_contact_that_would_close_is_refused(self):
        """The clash set where the valve passes: refused at the angle at which the whole scene closes it."""
        near = with_numbers(MOTORI, dict.fromkeys(matching(MOTORI, "coil_clash.gap_mm"), 9.0))
        whole = settled(near, self.LIFT).response
        assert idle_contacts([whole])[0] == frozenset()
        closing = whole.angle[np.argmax(whole.force[:, 3] > 0)]
        model = leave_out(near, self.CLASH, frozenset())
        train = build_train(model.scene)
        run = model.prepare(engine.prepare, train, self.LIFT, self.SPEED)
        with pytest.raises(MotionRefused, match=rf"'coil_clash'.* never closing.* at {np.degrees(closing):.0f}"):
            run(state_at_rest(train))

    def test_a_contact_that_would_open_is_refused(self):
        model = leave_out(MOTORI, frozenset(), self.SPRING)
        pulled = replace(model.watched, preload=np.array([-300.0]))
        record = self.revolution(model.scene)
        model.check(record)
        with pytest.raises(MotionRefused, match=r"'spring'.* never opening.* at -180.0 deg and 2500 cam"):
            replace(model, watched=pulled).check(record)

    def test_a_closing_between_two_samples_is_seen(self):
        model = leave_out(MOTORI, self.CLASH, frozenset())
        record = self.revolution(model.scene)
        peak = record.x[:, 0].max()
        keep = np.flatnonzero((record.x[:, 0] < peak - 2e-5) & np.append(np.diff(record.angle) > 0, True))
        coarse = replace(record, **{k: getattr(record, k)[keep] for k in ("angle", "lift", "x", "v", "force")})
        assert coarse.x.max() < peak - 1e-5
        closer, farther = (replace(model.watched, gap=np.array([gap])) for gap in (peak - 5e-6, peak + 5e-6))
        replace(model, watched=farther).check(coarse)
        with pytest.raises(MotionRefused, match="coil_clash"):
            replace(model, watched=closer).check(coarse)


class TestReduce:
    @pytest.fixture(scope="class")
    @staticmethod
    def found():
        return reduce(PUSHROD, speeds_rpm=(3000,), tolerance_mm=0.05)

    def test_the_proposal_is_within_the_tolerance_and_none_cheaper_is(self, found):
        best = found.proposed
        assert found.candidates[0].error["lift_mm"] == 0
        assert len(best.smaller.scene.mass) < 5
        assert all(best.error[k] <= 0.05 for k in ("bounce_mm", "jump_mm", "lift_mm"))
        assert not any(c.within(0.05) and c.operations < best.operations for c in found.candidates)
        nothing = replace(found, tolerance_mm=1e-9).proposed
        assert nothing is found.candidates[0]

    def test_the_proposal_is_the_same_whatever_the_clock_says(self, found):
        names = set()
        for seed in range(5):
            times = np.random.default_rng(seed).uniform(0.01, 10.0, len(found.candidates))
            timed = [replace(c, ms=dict.fromkeys(c.ms, t)) for c, t in zip(found.candidates, times, strict=True)]
            names.add(replace(found, candidates=tuple(timed)).proposed.smaller.scene.name)
        assert names == {found.proposed.smaller.scene.name}

    def test_the_count_of_operations(self, found):
        """Five masses: a propagator of 100 entries for every step, and two operations for each element."""
        train = build_train(PUSHROD)
        counted = first_steps(train, PUSHROD.cam_speed(3000.0)) * (100 + 2 * len(train.a))
        assert found.as_dict()["models"][0]["operations_per_revolution"] == found.candidates[0].operations == counted

    def test_errors_are_differences_of_settled_motions(self, found):
        lift = polydyne(PUSHROD)
        small = found.candidates[-1]
        assert len(small.smaller.scene.mass) == 1
        whole, one = (settled(s, lift, 3000.0).metrics(lift) for s in (PUSHROD, small.smaller.scene))
        for name in ("bounce_mm", "contact_force_max_N"):
            assert small.error[name] == pytest.approx(abs(whole.worst(name) - one.worst(name)), rel=1e-6, abs=1e-9)

    def test_the_content_has_every_model_and_the_proposed_scene(self, found):
        content = found.as_dict()
        assert parse_scene(content["proposed_toml"], "proposed") == found.proposed.smaller.scene
        assert {m["masses"] for m in content["models"]} == {1, 2, 3, 4, 5}

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [({"tolerance_mm": 0.0}, "tolerance"), ({"speeds_rpm": ()}, "speeds"), ({"speeds_rpm": (-1.0,)}, "speeds")],
    )
    def test_bad_input(self, arguments, sentence):
        with pytest.raises(InputError, match=sentence):
            reduce(PUSHROD, **arguments)
        with pytest.raises(InputError, match="needs valve"):
            reduce(load_scene("ohv-3dof"))

    def test_command(self, capsys, tmp_path):
        file = tmp_path / "reduction.json"
        words = ["reduce", "pushrod-5mass", "--speeds", "3000", "--tolerance-mm", "0.05", "--json", str(file)]
        assert cli.main(words) == 0
        lines, content = capsys.readouterr().out.splitlines(), json.loads(file.read_text())
        assert sum(line.startswith("pushrod-5mass") and "ms" not in line for line in lines) == len(content["models"])
        assert any(line.startswith(f"proposed: {content['proposed']} (") for line in lines)
        assert (content["tolerance_mm"], content["speeds_rpm"], content["cam"]) == (0.05, [3000.0], "polydyne")
        assert len(content["models"][1]["ms_per_revolution"]) == 3

    def test_times_are_told_where_processor_time_is_limited(self):
        """As by `ulimit -t`: the clock of the process then has ticks longer than a revolution takes."""
        code = (
            "import resource, sys\n"
            "resource.setrlimit(resource.RLIMIT_CPU, (600, resource.RLIM_INFINITY))\n"
            "from camopt.cli.parser import main\n"
            "sys.exit(main(['reduce', 'pushrod-5mass', '--speeds', '3000', '--tolerance-mm', '0.05']))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        assert "proposed: " in done.stdout
