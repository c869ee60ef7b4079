"""`camopt extremes`: what each verdict means, the list, the table on disk, and a defect that is found."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cli import parser as cli
from camopt.exact.kernel.propagators import highest_frequency
from camopt.scene import QUANTITIES, MotionRefused, build_train, load_scene
from camopt.study.extremes import extremes as module
from camopt.study.extremes.cases import CHANGES, cases, clearance, contacts, fast_mode, mass_ratio, times
from camopt.study.extremes.classification import (
    NOT_CONVERGED,
    RANGE,
    REFUSED,
    SAMPLES,
    WITHIN,
    WRONG,
    Truth,
    doubtful_figure,
    judge,
    truth,
)
from camopt.study.extremes.extremes import LINES, STEP_METHODS, defects, extremes
from camopt.study.measurements import COLUMNS
from camopt.verifier.convergence import Converged, Tolerances
from camopt.verifier.methods import rkg
from camopt.verifier.verdict import event_exact

NAMES = tuple(Tolerances(2.0).absolute)
MOTOR, KODAMA = load_scene("motori-1"), load_scene("kodama")


def answer(bounce=0.1, error=0.0, converged=True, state=True, others=1.0, **changed) -> Converged:
    figures = dict.fromkeys(QUANTITIES, others) | {"bounce_mm": bounce, **changed}
    spread, estimate = {name: (value, value) for name, value in figures.items()}, dict.fromkeys(QUANTITIES, error)
    return Converged(1440, converged, spread, estimate, 0, True, np.zeros(2) if state else None)


def true(spread=0.0) -> Truth:
    figures = dict.fromkeys(NAMES, 1.0) | {"bounce_mm": 0.1}
    moved = dict.fromkeys(NAMES, 0.0) | {"bounce_mm": spread}
    return Truth(figures, dict.fromkeys(NAMES, 0.003), moved, answer())


@pytest.mark.parametrize(
    ("given", "spread", "verdict"),
    [
        (answer(bounce=0.1029), 0.0, WITHIN),
        (answer(bounce=0.1031), 0.0, WRONG),
        (answer(bounce=0.1031, converged=False), 0.0, NOT_CONVERGED),
        (answer(bounce=0.1031, error=1e-3), 0.0, NOT_CONVERGED),
        (answer(bounce=0.1051, error=1e-3), 0.0, WRONG),
        (answer(bounce=0.2), 2e-4, WRONG),
        (answer(bounce=0.2), 4e-4, RANGE),
        (answer(bounce=np.nan), 0.0, WRONG),
        (answer(state=False), 0.0, REFUSED),
    ],
)
def test_a_verdict_follows_from_error_estimate_and_flag(given, spread, verdict):
    assert judge(given, true(spread))[0] == verdict


def test_a_reference_that_refuses_its_finest_step_is_no_truth():
    refused = []

    def prepare(train, lift, cam_speed, steps):
        if steps > 4 * SAMPLES[0]:
            refused.append(steps)
            raise MotionRefused("too fine")
        return event_exact(train, lift, cam_speed, steps)

    with pytest.raises(MotionRefused, match=f"at its finest step, {4 * SAMPLES[0] + 2} a revolution"):
        truth(prepare, build_train(MOTOR), polydyne(MOTOR), MOTOR.cam_speed(4000.0))
    assert refused


@pytest.mark.parametrize("order", [NAMES, NAMES[::-1]])
@pytest.mark.parametrize(
    ("bounce", "jump", "error", "spread", "verdict", "figure"),
    [
        (np.nan, 1.0, np.inf, 0.0, NOT_CONVERGED, "bounce_mm"),  # infinitely far off, and said to be
        (np.nan, 1.1, np.inf, 0.0, WRONG, "jump_mm"),
        (np.nan, 1.0, 1e-3, 0.0, WRONG, "bounce_mm"),
        (0.2, 1.1, 0.0, 1.0, WRONG, "jump_mm"),  # the motion moves the bounce
    ],
)
def test_an_error_that_is_told_or_the_motions_own_is_no_defect_and_hides_none(
    order, bounce, jump, error, spread, verdict, figure
):
    given = replace(answer(bounce, jump_mm=jump), error=dict.fromkeys(NAMES, 0.0) | {"bounce_mm": error})
    right = replace(true(spread), figures={name: true().figures[name] for name in order})
    assert judge(given, right)[:2] == (verdict, figure)
    endless = replace(answer(), error=dict.fromkeys(NAMES, 1.0) | {"bounce_mm": np.inf})
    however_moved = replace(right, answer=endless, spread=dict.fromkeys(NAMES, np.inf))
    assert doubtful_figure(however_moved) == ("bounce_mm", np.inf)


class TestTheList:
    def test_changes_do_what_they_say(self):
        def built(change, *numbers):
            return build_train(change(KODAMA, *numbers))

        assert highest_frequency(built(fast_mode, 72e3)) / (2 * np.pi) > 60e3
        mass = built(mass_ratio, 1e4).mass
        assert mass.max() / mass.min() == pytest.approx(1e4)
        stiff = built(contacts, 1e9)
        assert np.all(stiff.stiffness[stiff.contact] == 1e9)
        assert built(times, "damping_N_s_per_m", 0.0).damping.max() == 0.0
        assert built(clearance, 1.0).lash == pytest.approx(1e-3) and built(clearance, 0.0).lash == 0.0
        spring = MOTOR.element[1]
        assert contacts(MOTOR, 1e9).element[1] == spring  # a preloaded contact that is the valve spring

    def test_every_change_alone_and_on_kodama_every_two_of_different_kinds(self):
        singles = 1 + sum(len(kind) for kind in CHANGES.values())
        assert len(list(cases(MOTOR))) == singles
        names = [name for name, _ in cases(KODAMA)]
        assert len(names) == len(set(names)) == singles + 4 * 10  # two of five kinds, two changes each
        assert {max(scene.operation.speeds_rpm) for _, scene in cases(MOTOR)} == {300.0, 7000.0, 15_000.0}


@pytest.fixture
def short(monkeypatch):
    """Two cases of one scene and the compiled methods of fixed steps."""
    monkeypatch.setattr(module, "cases", lambda scene: [c for c in cases(scene) if c[0] in ("as it is", "15000 r/min")])
    monkeypatch.setattr(module, "SMOOTH", {})
    monkeypatch.setattr(module, "DOP853_STEPS", 0)
    monkeypatch.setattr(module, "NARROWER", {})


def read(folder) -> list[dict]:
    with open(folder / "extremes.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def untimed(rows) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def test_command_writes_the_table_and_goes_on_where_it_was_interrupted(short, tmp_path, capsys):
    folder = tmp_path / "run"
    assert cli.main(["extremes", "motori-1", "--out", str(folder), "--quiet"]) == 0
    rows = read(folder)
    assert tuple(rows[0]) == COLUMNS
    assert {r["case"] for r in rows} == {f"motori-1: {c}" for c in ("as it is", "15000 r/min", "steps past the limit")}
    assert {"event", *STEP_METHODS} <= {r["method"] for r in rows}
    past = [r["verdict"] for r in rows if r["case"].endswith("past the limit")]
    assert len(past) == len(STEP_METHODS) and not {WITHIN, WRONG} & set(past)
    assert sum(r["verdict"] == WITHIN for r in rows) >= 4
    assert (folder / "figures" / "extremes-motori-1.png").stat().st_size > 0
    assert cli.main(["extremes", "motori-1", "--out", str(folder)]) == 2

    file = folder / LINES
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-3]) + lines[-3][:20])
    again = extremes([MOTOR], folder, resume=True, progress=False)
    assert untimed(read(folder)) == untimed(rows)
    assert len(again) == len(rows) and not defects(again)


def test_a_method_of_another_train_is_found_out(short, tmp_path, monkeypatch, capsys):
    def softer(train, lift, cam_speed, steps):
        return rkg.prepare(replace(train, stiffness=0.9 * train.stiffness), lift, cam_speed, steps)

    monkeypatch.setitem(STEP_METHODS, "rkg", softer)
    assert cli.main(["extremes", "motori-1", "--out", str(tmp_path / "run"), "--quiet"]) == 3
    assert "wrong: motori-1: 15000 r/min, rkg: " in capsys.readouterr().out
