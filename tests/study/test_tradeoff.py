"""`camopt tradeoff`: files, columns, errors against the reference, a run that goes on, refusals, and the words."""

import csv
import json
import time
from itertools import chain, repeat
from unittest.mock import Mock

import numpy as np
import pytest

from camopt.cam.design_file import write_design
from camopt.cam.families.polydyne import polydyne
from camopt.cli import parser as cli
from camopt.exact.settled import settled_metrics
from camopt.measure.limits import broken_by_shape
from camopt.plots.studies import figures, pareto
from camopt.scene import InputError, build_train, load_scene, scene_text
from camopt.storage.journal import Records
from camopt.study import measurements
from camopt.study.measurements import COLUMNS, REFERENCE, measured, timed
from camopt.study.tradeoff import tradeoff as module
from camopt.study.tradeoff.methods import CHORDS, RevolutionCase, prepared_methods
from camopt.study.tradeoff.tradeoff import LINES, error_of, rows_of, tables_of, tradeoff
from experiments import tradeoff as experiment

NAMES = "case", "method", "setting"


def table(folder) -> list[dict]:
    with open(folder / "tradeoff.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def line(case: str, method: str, *, verdict: str | None = None, seconds: float = 1.0, **figures) -> dict:
    """A line of the journal."""
    said = {} if verdict is None else {"verdict": verdict}
    shared = {"case": case, "method": method, "setting": "s", "failure": "", "seconds": seconds}
    return {**shared, "figures": figures, **said}


def row(method: str, setting: str, error: float, seconds: float, **more) -> dict:
    """A row of tradeoff.csv."""
    fixed = {"case": "revolution at 7000 r/min", "error_of": "lift_mm", "converged": True, "verdict": ""}
    return {**fixed, "method": method, "setting": setting, "error": error, "seconds": seconds, **more}


def busy(seconds: float) -> None:
    """Uses that much processor time."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def command(*words) -> int:
    return cli.main(["tradeoff", *map(str, words), "--quiet"])


@pytest.fixture(scope="module")
def drawn():
    """Figures by name, as they would be saved: rendering them takes longer than measuring, which is not repeated."""
    kept = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("camopt.plots.style.save", lambda figure, folder, name: kept.update({name: figure}))
        patch.setattr(measurements, "PATIENCE", 0.0)
        yield kept


@pytest.fixture(scope="module")
def small(tmp_path_factory, drawn):
    """The small size on one mass, by the command."""
    folder = tmp_path_factory.mktemp("tradeoff") / "run"
    assert command("motori-1", "--size", "small", "--out", folder) == 0
    return folder


class TestRun:
    def test_files_and_columns(self, small):
        rows = table(small)
        assert tuple(rows[0]) == COLUMNS
        chosen, *dials = (small / "tradeoff.txt").read_text().split("\n\n")
        assert sum(line.startswith("*") for line in chosen.splitlines()) == 1
        assert [text.partition(",")[0] for text in dials] == [
            "Settling tolerance", "Band step", "Perturbation samples", "Masses"
        ]  # fmt: skip
        setup = (small / "setup.csv").read_text().splitlines()
        assert setup[0] == "case,method,setting,setup_seconds" and len(setup) == 6

    def test_figures(self, small, drawn):
        names = {"revolution-at-7000-rmin", "job", "masses"}
        assert set(drawn) == names
        labels = [axes.get_ylabel() for axes in drawn["revolution-at-7000-rmin"].axes]
        assert labels == ["error of bounce [mm]", "error of jump [mm]", "error of seating velocity [m/s]",
                          "error of valve lift [mm]"]  # fmt: skip
        for figure in drawn.values():
            assert all(axes.get_xscale() == axes.get_yscale() == "log" for axes in figure.axes)
            assert all(len(axes.lines) > 1 for axes in figure.axes)  # a method at least, and the front

    def test_errors_and_times_are_sane(self, small):
        lifts = {r["method"]: r for r in table(small) if r["error_of"] == "lift_mm" and r["case"].startswith("rev")}
        assert float(lifts["event-exact"]["error"]) < 1e-6
        for method in ("Runge-Kutta-Gill", "transition matrix", "Houbolt"):
            assert 1e-6 < float(lifts[method]["error"]) < 5e-3  # they step over no contact: those of this cam hold
        assert all(1e-6 < float(r["seconds"]) < 60 for r in table(small))
        (finest,) = (r for r in table(small) if (r["case"], r["method"]) == ("job: band step", REFERENCE))
        assert float(finest["error"]) == 0.0

    def test_a_finished_run_measures_nothing_again(self, small):
        before = (small / LINES).read_bytes(), (small / "tradeoff.csv").read_bytes()
        assert command("motori-1", "--size", "small", "--out", small, "--resume") == 0
        assert ((small / LINES).read_bytes(), (small / "tradeoff.csv").read_bytes()) == before

    def test_refusals(self, small, tmp_path, capsys):
        assert command("motori-1", "--out", small) == 2
        assert command("motori-1", "--resume") == 2
        assert command("ohv-3dof", "--out", tmp_path / "a") == 2
        assert command("motori-2", "--size", "small", "--out", small, "--resume") == 2
        assert "belongs to another run, and nothing in it was changed: its scene differs" in capsys.readouterr().err
        with pytest.raises(InputError, match="size 'huge': expected one of small, full"):
            tradeoff(load_scene("motori-1"), tmp_path / "b", size="huge")


class TestCams:
    @pytest.fixture
    def unequal(self, tmp_path):
        """A scene whose ramps differ, for which there is no plain Polydyne."""
        path = tmp_path / "unequal.toml"
        path.write_text(scene_text("motori-1").replace("[design]", "[design]\nclosing_ramp_height_mm = 0.3"))
        return path

    def test_a_cam_that_the_scene_does_not_allow_is_refused_before_the_folder_is_made(self, unequal, tmp_path, capsys):
        folder = tmp_path / "run"
        assert command(unequal, "--cam", "polydyne", "--size", "small", "--out", folder) == 2
        assert "closing ramp differs" in capsys.readouterr().err and not folder.exists()

    def test_the_cam_that_is_taken_where_none_is_given_holds(self, unequal):
        """At the fastest speed the plain Polydyne of motori-1 bounces by a tenth of a millimetre."""
        for scene in (load_scene("motori-1"), load_scene(str(unequal))):
            cam, speed = module.holding_cam(scene), scene.operation.speeds_rpm[-1]
            found = settled_metrics([build_train(scene)], [cam], [scene.cam_speed(speed)])
            assert found.worst("bounce_mm")[0, 0, 0] < 0.02 and found.worst("jump_mm")[0, 0, 0] < 0.02
            assert broken_by_shape(cam, scene.design) == []

    def test_a_given_cam_is_the_one_that_is_measured(self, unequal, tmp_path, drawn, monkeypatch, capsys):
        scene, design = load_scene("motori-1"), tmp_path / "design.json"
        write_design(design, polydyne(scene), 9.4e-3)
        seen = []
        monkeypatch.setattr(module, "measured", lambda journal, work, progress: seen.extend(work) or [])
        words = unequal, "--cam", design, "--size", "small", "--out", tmp_path / "run"
        assert command(*words) == 0
        assert len(seen) > 10
        write_design(design, polydyne(scene, (2, 8, 14, 20, 26)), 9.4e-3)
        assert command(*words, "--resume") == 2
        assert "belongs to another run" in capsys.readouterr().err

    def test_nothing_wrong_about_anything_is_no_figure(self):
        """No cam of the list bounces: every dial's errors are zero, and there is nothing to draw over time."""
        cases = "job: band step", "revolution at 3000 r/min", "job: masses"
        assert figures([row("m", "s", 0.0, 1.0, case=case, error_of="bounce_mm") for case in cases]) == {}


class TestLines:
    def test_what_the_journal_holds_is_not_measured_again(self):
        calls: list[str] = []

        def work(name: str):
            return ("case", "method", name), lambda: calls.append(name) or {"figures": {"bounce_mm": 1.0}}

        journal = Records(None, *NAMES)
        measured(journal, [work("a"), work("b")])
        assert [line["setting"] for line in measured(journal, [work("c"), work("a")])] == ["c", "a"]
        assert calls == ["a", "b", "c"]

    def test_what_fails_stays_with_its_reason(self):
        failing = ("case", "method", "x"), Mock(side_effect=RuntimeError("too stiff"))
        (row,) = rows_of(measured(Records(None, *NAMES), [module.or_failure(failing)]))
        assert (row["verdict"], row["converged"], row["error"]) == ("too stiff", False, None)

    def test_errors_are_against_the_reference_of_the_case(self):
        lines = [line("a", REFERENCE, bounce_mm=1.0, verdict="confirmed"), line("b", REFERENCE, bounce_mm=5.0)]
        lines += [line("a", "m", bounce_mm=0.75, verdict="rejected"), line("b", "m", bounce_mm=5.5)]
        del lines[1]["seconds"]  # a reference that was not timed is no row
        found = {(r["case"], r["method"], r["error_of"]): r["error"] for r in rows_of(lines)}
        assert found == {
            ("a", REFERENCE, "bounce_mm"): 0.0,
            ("a", REFERENCE, "verdict"): 0.0,
            ("a", "m", "bounce_mm"): 0.25,
            ("a", "m", "verdict"): 1.0,
            ("b", "m", "bounce_mm"): 0.5,
        }

    def test_error_of(self):
        assert error_of([1.0, 2.5], [1.0, 2.0]) == 0.5
        assert error_of(None, 1.0) is error_of(np.nan, 1.0) is None

    def test_the_first_call_is_set_apart(self, monkeypatch):
        monkeypatch.setattr(measurements, "PATIENCE", 0.05)
        durations = chain((0.05, 0.004, 0.002), repeat(0.004))
        times, _ = timed(lambda: busy(next(durations)), 2)
        assert times["seconds"] == pytest.approx(0.001, rel=0.2)
        assert times["setup_seconds"] == pytest.approx(0.048, rel=0.1)

    def test_waiting_is_not_counted(self, monkeypatch):
        monkeypatch.setattr(measurements, "PATIENCE", 0.01)
        times, _ = timed(lambda: time.sleep(0.02) or busy(0.01))
        assert times["seconds"] == pytest.approx(0.01, rel=0.1)


def test_under_curved_laws_event_exact_takes_chords():
    scene = load_scene("race-nested")
    case = RevolutionCase(scene, polydyne(scene), max(scene.operation.speeds_rpm))
    chords = {setting: run for method, setting, run in prepared_methods(case, "full") if method == "event-exact"}
    assert list(chords) == [f"{count} chords" for count in CHORDS["full"]]
    lifts = [case.figures(case.two(chords[f"{count} chords"]()))["lift_mm"] for count in (8, 16, 128)]
    coarse, fine = (np.abs(lift - lifts[2]).max() for lift in lifts[:2])
    assert 0.0 < 3 * fine < coarse < 1e-3


def test_the_front_is_what_nothing_beats():
    seconds, errors = np.array([3.0, 1.0, 2.0, 4.0, 1.0]), np.array([2.0, 5.0, 6.0, 1.0, 4.0])
    assert pareto(seconds, errors).tolist() == [4, 0, 3]


class TestTables:
    def test_one_row_is_recommended_the_cheapest_within_a_micrometre(self):
        rows = [
            row("fast", "coarse", 2e-3, 1e-3),
            row("fast", "fine", 1e-4, 8e-3),
            row("slow", "any", 1e-9, 0.5),
            row("wrong", "coarse", 0.5, 1e-4),
            row("wrong", "fine", 0.2, 1e-2),
            row("cheap", "at another speed", 1e-9, 1e-6, case="revolution at 5000 r/min"),
        ]
        (case, lines), other = tables_of(sorted(rows, key=lambda r: r["case"], reverse=True)).items()
        assert case in lines[0] and "at another speed" in other[1][2]
        assert [line.split() for line in lines[2:]] == [
            ["*", "fast", "fine", "8", "0.1"],
            ["slow", "any", "500", "1e-06"],
            ["wrong", "fine", "10", "2e+02"],
        ]
        assert not any(line.split()[0] == "*" for line in tables_of(rows[3:5])[case][2:])
        assert tables_of([]) == {}

    def test_dials_of_the_job(self):
        dial = {"error_of": "bounce_mm", "case": "job: knots"}
        area = dial | {"error_of": "area_mm_deg", "verdict": "confirmed"}
        rows = [
            row("search", "3 deg", 0.0021, 0.4, **dial | {"verdict": "confirmed"}),
            row("search", "3 deg", 0.5, 0.4, **area),
            row(REFERENCE, "2 deg", 0.0, 1.5, **dial),
        ]
        (lines,) = tables_of(rows).values()
        assert lines[0].startswith("Knots")
        assert [line.split() for line in lines[2:]] == [
            ["3", "deg", "0.4", "2.1", "0.5", "confirmed"],
            ["2", "deg", "1.5", "0"],
        ]


class TestExperiment:
    def test_it_keeps_the_runs_table(self, small, tmp_path):
        content = experiment.keep(small, "small", tmp_path)
        stored = json.loads((tmp_path / "tradeoff.json").read_text())
        assert len(stored["rows"]) == len(table(small))
        assert content["float32"] == []  # the small size has no JAX

    def test_rounding_is_what_single_precision_changes(self):
        measured = (REFERENCE, 1.0, 1.0), ("x, float64", 1.5, 2.0), ("x, float32", 1.25, 1.0)
        lines = [line("c", method, lift_mm=[0.0, mm], seconds=seconds) for method, mm, seconds in measured]
        (row,) = experiment.rounding(lines)
        found = row["float32_moves_lift_um"], row["float64_error_um"], row["time_ratio"]
        assert found == pytest.approx((250, 500, 0.5))
