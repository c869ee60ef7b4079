"""`simulate --accuracy`: what was asked and what was delivered; chaos is answered by a range."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.exact import engine
from camopt.scene import InputError, MotionRefused, build_train, load_scene, scene_text
from camopt.scene.load import parse_scene
from camopt.scene.rest import state_at_rest
from camopt.study.simulate import accuracy_control as module
from camopt.study.simulate import motion as motion_module
from camopt.study.simulate.accuracy_control import ANGLES, apart_um, deliver
from camopt.study.simulate.motion import dialled, simulate
from camopt.verifier.accuracy import Curve, stored_curves
from tests.command_line import run as command

MOTOR, KODAMA = load_scene("motori-1"), load_scene("kodama")
CURVED_TEXT = scene_text("motori-1").replace(
    "stiffness_N_per_m = 1.5e8", 'law = "hertz"\nexponent = 1.5\nstiffness_N_per_m = 5.8e10', 1
)
CURVED = parse_scene(CURVED_TEXT, "curved")


def apart(motion, truth) -> float:
    """Largest difference of the valve's positions [um]."""
    one, other = (found.position_mm.sel(mass=MOTOR.valve).values for found in (motion, truth))
    return 1e3 * np.abs(one - other).max()


def shifted(by: float):
    """A revolution of the motor whose positions are off [m]."""
    train = build_train(MOTOR)
    response = engine.prepare(train, polydyne(MOTOR), MOTOR.cam_speed(3000), 720)(state_at_rest(train))
    return replace(response, x=response.x + by)


class TestSimulate:
    CAM = polydyne(MOTOR)

    @pytest.mark.parametrize(("method", "asked"), [("event", 0.01), ("rkg", 10.0), ("rkg", 1.0), ("tmm", 5.0)])
    def test_the_error_is_what_was_asked_for(self, method, asked):
        truth = simulate(MOTOR, self.CAM, 3000, "event")
        motion = simulate(MOTOR, self.CAM, 3000, method, accuracy=asked)
        assert (
            apart(motion, truth) <= motion.attrs["accuracy_estimated_um"] <= asked == motion.attrs["accuracy_asked_um"]
        )
        assert motion.attrs["accuracy_reached"] == 1
        assert motion.attrs["accuracy_statement"].startswith(f"requested accuracy: {asked:g} um; estimated error")

    def test_a_name_is_taken_as_its_tolerance(self):
        motion = simulate(MOTOR, self.CAM, 3000, accuracy="draft")
        assert (motion.attrs["accuracy_asked"], motion.attrs["accuracy_asked_um"]) == ("draft", 5.0)
        assert "5 um (draft)" in motion.attrs["accuracy_statement"]

    @pytest.mark.parametrize("method", ["event", "rkg"])
    def test_without_it_nothing_is_claimed_of_straight_laws(self, method):
        assert not [a for a in simulate(MOTOR, self.CAM, 3000, method).attrs if a.startswith("accuracy")]

    @pytest.mark.parametrize("accuracy", ["rough", 0.0, -1.0, float("nan"), float("inf")])
    def test_refusals(self, accuracy):
        with pytest.raises(InputError, match="accuracy"):
            simulate(MOTOR, self.CAM, 3000, accuracy=accuracy)


class TestCurvedLaws:
    """motori-1 with its cam contact by Hertz, of which event-exact makes chords; DOP853 takes the law as it is."""

    CAM = polydyne(CURVED)

    @pytest.mark.parametrize("step_deg", [0.1, 1.0])
    def test_a_motion_without_an_accuracy_states_its_error(self, step_deg):
        motion = simulate(CURVED, self.CAM, 5000, step_deg=step_deg)
        truth = simulate(CURVED, self.CAM, 5000, "dop853", step_deg=step_deg)
        true_um = apart(motion, truth)
        assert 0.01 < true_um <= motion.attrs["accuracy_estimated_um"] < 50 * true_um
        assert motion.attrs["accuracy_estimated_um"] == motion.attrs["accuracy_estimated_by_revolution_um"].max()
        said = f"estimated error of the valve's position: {motion.attrs['accuracy_estimated_um']:.2g} um, from "
        assert motion.attrs["accuracy_statement"].startswith(said)
        assert motion.attrs["accuracy_statement"].endswith(" chords in place of curved laws")

    def test_the_terminal_states_it_too(self, capsys, tmp_path):
        file = tmp_path / "curved.toml"
        file.write_text(CURVED_TEXT)
        code, out, _ = command(capsys, "simulate", str(file), "--cam", "polydyne", "--speed", "5000", "--step-deg", "1")
        assert code == 0 and out.splitlines()[1].startswith("estimated error of the valve's position: ")

    def test_an_accuracy_is_kept(self):
        truth = simulate(CURVED, self.CAM, 5000, "dop853")
        motion = simulate(CURVED, self.CAM, 5000, accuracy=0.5)
        assert apart(motion, truth) <= motion.attrs["accuracy_estimated_um"] <= 0.5

    def test_every_setting_of_the_dial_has_chords_of_its_own(self, monkeypatch):
        """At a high speed, where a revolution has few steps, too: equal answers would be taken for an exact one."""
        counts = []
        monkeypatch.setattr(motion_module, "_motion", lambda *given: counts.append(given[5:]))
        for number in range(7):
            dialled(build_train(CURVED), self.CAM, CURVED.cam_speed(60_000), "event", 2)(0.3 / 2**number)
        assert [chords for _, chords in counts] == [16, 23, 32, 45, 64, 91, 128]

    def test_a_fine_table_has_no_more_chords_than_an_accuracy_may_choose(self, monkeypatch):
        monkeypatch.setattr(motion_module, "MOST_CHORDS", 20)
        assert (
            simulate(CURVED, self.CAM, 5000).attrs["accuracy_statement"].endswith(" 20 chords in place of curved laws")
        )

    def test_an_accuracy_beyond_the_budget_ends_with_the_best(self, monkeypatch):
        monkeypatch.setattr(motion_module, "MOST_CHORDS", 48)
        motion = simulate(CURVED, self.CAM, 5000, accuracy=1e-5)
        best = motion.attrs["accuracy_estimated_um"]
        assert motion.attrs["accuracy_reached"] == 0 and 1e-3 < best < 10.0
        assert motion.attrs["accuracy_statement"].startswith(
            "requested accuracy: 1e-05 um; not reached within the budget of 4 settings: the valve's position is known "
            "to a range only, at best +-"
        )
        assert simulate(CURVED, self.CAM, 5000, accuracy=10 * best).attrs["accuracy_reached"] == 1


def test_the_budget_of_the_chords_is_known():
    """The settings from 16 to 128 chords, whatever is asked: a wish that nothing fulfils must not run for ever."""
    train = build_train(CURVED)
    for asked in (10.0, 1e-5):
        tried = []

        def run(setting: float, tried=tried):
            tried.append(setting)
            return shifted(1e-3 * len(tried))

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(motion_module, "dialled", lambda *_, run=run: run)
            found = motion_module.delivered(train, polydyne(CURVED), CURVED.cam_speed(5000), "event", 1, asked)
        assert 6 <= len(tried) == found.budget <= 7 and not found.reached
        assert 0.3 / 64 < 1.0001 * tried[-1] < 0.3 / 32


def test_chaos_is_answered_by_a_range(monkeypatch):
    """Beyond the jump round-off itself grows past what is asked: the revolution it happens in is told."""
    monkeypatch.setattr(module, "MOST_VALUES", 1e6)  # finer would take seconds and change nothing
    motion = simulate(KODAMA, polydyne(KODAMA), 7000, "event", revolutions=4, step_deg=0.5, accuracy=0.1)
    by_revolution = motion.attrs["accuracy_estimated_by_revolution_um"]
    assert motion.attrs["accuracy_reached"] == 0
    assert by_revolution[0] < 0.1 < 1.0 < by_revolution[3]
    assert "settings: the valve's position is known to a range only" in motion.attrs["accuracy_statement"]
    assert f"+-{by_revolution[3]:.2g} um in revolution 4" in motion.attrs["accuracy_statement"]


class TestDial:
    """`deliver` on a made-up method whose valve stands off by the setting."""

    START = stored_curves()["rkg"].coarsest(1.0, typical=True)

    @staticmethod
    def run(offset, refuse=lambda setting: False):
        calls = []

        def motion(setting: float):
            calls.append(setting)
            if refuse(setting):
                raise MotionRefused("too coarse")
            return shifted(offset(setting))

        return motion, calls

    def test_halved_until_three_coarser_answers_stand(self):
        """Off by 10 um times the setting over the stored one: answers differ by 7 times the last error, and half as
        much again is said."""
        run, calls = self.run(lambda s: 10e-6 * s / self.START)
        found = deliver(run, "rkg", 1.0, 1, self.START / 1e6)
        assert found.reached and calls == pytest.approx([self.START / 2**i for i in range(-1, 8)])
        assert found.estimate_um[0] == pytest.approx(1.5 * 7 * 10 / 2**7, rel=1e-6)
        assert found.setting == calls[-1]

    def test_the_best_of_the_budget_is_delivered_and_not_the_last(self):
        offsets = iter([8e-6, 4e-6, 2e-6, 1e-6, 9e-6])
        run, calls = self.run(lambda s: next(offsets))
        found = deliver(run, "rkg", 1.0, 1, self.START / 8)
        assert len(calls) == 5 and found.setting == calls[3] and not found.reached
        assert found.estimate_um[0] == pytest.approx(1.5 * 7.0)
        assert found.sentence() == (
            "requested accuracy: 1 um; not reached within the budget of 5 settings: the valve's position is known to a "
            "range only, at best +-11 um in revolution 1"
        )

    def test_nothing_below_the_least_error_that_is_stated_is_tried(self):
        run, calls = self.run(lambda s: 0.0)
        found = deliver(run, "rkg", 1e-5, 1, stored_curves()["rkg"].coarsest(1e-5, typical=True) / 1e6)
        assert len(calls) == 4 < found.budget and found.estimate_um[0] == module.FINEST_UM and not found.reached

    def test_settings_that_are_all_refused_but_few_leave_the_error_unknown(self):
        run, _ = self.run(lambda s: 0.0, refuse=lambda s: s > 0.2 * self.START)
        found = deliver(run, "rkg", 1.0, 1, self.START / 8)
        assert found.sentence().endswith("5 settings, too few of which gave a motion: the error is not known")

    def test_the_finest_setting_ends_it_unreached_and_the_bar_shows_what_is_spent(self, monkeypatch):
        shown = []

        class Bar(module.tqdm):
            def update(self, n=1):
                super().update(n)
                shown.append((self.n, self.total))

        monkeypatch.setattr(module, "tqdm", Bar)
        monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
        further = count()
        run, calls = self.run(lambda s: 1e-3 * next(further))
        found = deliver(run, "rkg", 1.0, 1, self.START / 8, progress=True)
        assert shown == [(1, 31), (3, 31), (7, 31), (15, 31), (31, 31)]
        assert len(calls) == found.budget == 5 and not found.reached
        assert found.estimate_um[0] == pytest.approx(1.5 * 3000.0)

    def test_refused_settings_are_passed_over_and_all_refused_is_a_refusal(self):
        run, calls = self.run(lambda s: 0.0, refuse=lambda s: s > 0.3 * self.START)
        assert deliver(run, "rkg", 1.0, 1, self.START / 1e6).reached
        assert len(calls) == 7
        run, _ = self.run(lambda s: 0.0, refuse=lambda s: True)
        with pytest.raises(MotionRefused, match="too coarse"):
            deliver(run, "rkg", 1.0, 1, self.START / 8)

    def test_promises_of_an_erratic_method_are_kept(self, monkeypatch):
        """Off by a share of the setting that is as good as drawn anew at every setting, as a method that steps across
        contacts is: one promise in 240 is broken, where two coarser answers alone broke one in ten."""
        monkeypatch.setattr(module, "valve_position", lambda answer, revolutions: np.full(ANGLES + 1, answer))
        rng, broken, draws = np.random.default_rng(1), 0, 2000
        for _ in range(draws):
            asked = 10 ** rng.uniform(-1, 1)
            start, size = stored_curves()["tmm"].coarsest(asked, typical=True), 10 ** rng.uniform(-6, -4)
            found = deliver(lambda s, z=size, t=start: z * rng.uniform() * s / t, "tmm", asked, 1, start / 1e9)
            assert found.reached
            broken += 1e6 * found.response > asked
        assert broken / draws < 0.011  # one in 240, and four standard deviations of 2000 draws


def test_apart_is_the_largest_difference_of_each_revolution():
    answer = np.zeros(2 * ANGLES + 1)
    other = answer.copy()
    other[5], other[ANGLES + 7] = 3e-6, -8e-6
    np.testing.assert_allclose(apart_um(answer, [other, answer], 2), [3.0, 8.0])


class TestCurves:
    CURVE = Curve(np.array([0.01, 0.1, 1.0]), np.array([1.0, 10.0, 100.0]), np.array([3.0, 2.0, 300.0]))

    def test_between_settings_on_the_logarithms_and_never_outside(self):
        assert self.CURVE.coarsest(np.sqrt(1000.0), typical=True) == pytest.approx(np.sqrt(0.1))
        assert self.CURVE.coarsest(1e-9, typical=True) == pytest.approx(0.01)
        assert self.CURVE.coarsest(1e9, typical=True) == pytest.approx(1.0)

    def test_an_erratic_curve_is_read_as_its_largest_error(self):
        assert self.CURVE.coarsest(2.5) == pytest.approx(0.01)  # 2 um at 0.1 is luck: 0.01 gave 3
        assert self.CURVE.coarsest(3.1) == pytest.approx(0.1, rel=0.05)

    def test_the_stored_ones_rise(self):
        for name, curve in stored_curves().items():
            assert np.all(np.diff(curve.setting) > 0), name
            assert np.all(curve.median_um <= curve.p90_um), name
            assert curve.p90_um[-1] > curve.p90_um[0] >= 0, name
