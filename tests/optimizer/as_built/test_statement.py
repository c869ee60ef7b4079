"""What a run says of trains as built: stated by every job, by trains that are judged once, and resumed."""

import json
import shutil
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from camopt.cam.design_file import read_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.read import read_cam
from camopt.measure.as_built import trains_as_built
from camopt.measure.yield_words import ENOUGH, HELD, MISSED, NOT_ASKED, asked_sentence, share_sentence, standing
from camopt.measure.yields import Looks, UsedLimits
from camopt.optimizer import candidates
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built import measured, prices, statement
from camopt.optimizer.as_built.measured import CHUNK, Track
from camopt.optimizer.as_built.search import free_program
from camopt.optimizer.as_built.statement import by_independent_methods, looks_of, sampled, statement_of_run
from camopt.optimizer.baselines import comparison
from camopt.optimizer.run import optimize
from camopt.optimizer.search.judge import IRREGULAR
from camopt.report import write_report
from camopt.report.folder import read_run_folder
from camopt.report.outcome import outcome_lines
from camopt.report.regenerated import differences
from camopt.scene import load_scene, parse_scene
from camopt.scene.errors import NoCamFound
from camopt.storage.journal import Records
from tests.documented_keys import undocumented
from tests.optimizer.as_built.test_yield_search import SCENE
from tests.scene.test_load import EXAMPLE

JOB = {"speeds": "band", "accuracy": "draft", "gradient": "none", "compare": False}
SETTINGS = {"accuracy": "draft", "speeds": "band", "seed": 0}
NOMINAL = SETTINGS | {"speeds": "nominal"}


@pytest.fixture(scope="module", autouse=True)
def few_baselines():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "SECTIONED", ())
        patch.setattr(candidates, "FAMILIES", ("polydyne",))
        patch.setattr(prices, "TRAINS", 20)
        yield


@contextmanager
def noted_trains():
    """Numbers of the trains that are judged inside."""
    numbers, used = [], Track.used

    def noted(self, trains):
        numbers.extend(one.number for one in trains)
        return used(self, trains)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Track, "used", noted)
        yield numbers


@pytest.fixture(scope="module")
def interrupted(undrawn, tmp_path_factory):
    """The folder of a job that was killed after two chunks of its trains."""
    folder, add, chunks = tmp_path_factory.mktemp("runs") / "run", Records.add, []

    def killed(self, *row):
        if len(chunks) == 2:
            raise KeyboardInterrupt
        chunks.append(row)
        add(self, *row)

    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Records, "add", killed)
        optimize(SCENE, out=folder, **JOB)
    return folder


@pytest.fixture(scope="module")
def resumed(interrupted, tmp_path_factory):
    """The same job gone on with, and the numbers of the trains that were judged then."""
    folder = tmp_path_factory.mktemp("resumed") / "run"
    shutil.copytree(interrupted, folder)
    with noted_trains() as judged:
        return optimize(SCENE, out=folder, resume=True, **JOB), judged


@pytest.fixture(scope="module")
def job(resumed):
    return resumed[0]


@pytest.fixture(scope="module")
def page(job):
    write_report(job.folder)
    return (job.folder / "report.html").read_text()


@pytest.fixture(scope="module")
def of_polydyne(job, tmp_path_factory):
    """The statement on another cam, beside the journal of the job's, and the numbers of the trains that were judged."""
    folder = tmp_path_factory.mktemp("another")
    shutil.copy(job.folder / statement.JOURNAL, folder)
    with noted_trains() as judged:
        return statement_of_run(SCENE, polydyne(SCENE), SETTINGS, folder), judged


def test_a_job_states_the_share_although_none_was_asked_for(job):
    found = json.loads((job.folder / "verification.json").read_text())["yield"]
    assert {key: found[key] for key in found if key != "advised"} == json.loads(json.dumps(job.as_built.as_dict()))
    assert found["wanted"] is None and found["confirmed"] is None and found["trains"] == 100
    assert found["low"] < found["share"] < found["high"] < 0.95  # where the first look decides, counting ends
    assert found["speeds_rpm"] == np.linspace(5000, 7000, ACCURACIES["draft"].stated_speeds).tolist()
    assert sum(entry["trains"] for entry in found["first_broken"].values()) == round(
        found["trains"] * (1 - found["share"])
    )
    assert found["unexplained"] == pytest.approx(max(0.0, 1.0 - sum(found["blame"].values())))
    assert job.exit_code == 0  # what was asked holds
    assert str(job.as_built.share) in repr(job) and share_sentence(found) in job._repr_html_()


def test_terminal_and_page_say_it(job, page):
    lines = outcome_lines(read_run_folder(job.folder))
    row = next(line for line in lines if line.startswith("trains as built that hold"))
    assert f"{100 * job.as_built.share.share:.3g}" in row
    assert any(line.startswith("as built: ") and line.endswith("no yield was requested") for line in lines)
    assert '<section class="verdict doubt">' in page and "as built" in page and "No yield was requested." in page
    assert undocumented(job.folder) == set()
    assert differences(job.folder) == []


def test_a_job_estimates_the_cam_that_is_advised(job, page):
    """The first program of the search for a yield says what a cam for 95 % would have, and no more than this one."""
    found = json.loads((job.folder / "verification.json").read_text())["yield"]["advised"]
    at_most = job.lift.area_ratio_in(SCENE.design)
    assert found == {"share": 0.95, "area_ratio": min(prices.estimated_area_ratio(SCENE, 0.95), at_most)}
    (line,) = (line for line in outcome_lines(read_run_folder(job.folder)) if "estimates an area ratio" in line)
    assert f"{found['area_ratio']:.3f}" in line and line in page and "(estimated area ratio 0." in page
    assert statement.beside(SCENE, job.lift, NOMINAL, job.as_built, job.folder) == {}  # of nominal speeds alone


def test_beside_a_cam_for_a_yield_lies_the_one_for_the_train_as_designed(tmp_path, monkeypatch):
    few = replace(ACCURACIES["draft"], foretold_trains=10, shaping_trains=10, unseen_trains=20)
    monkeypatch.setitem(ACCURACIES, "draft", few)
    monkeypatch.setattr(statement, "IDEAL_TRAINS", 10)
    run = optimize(SCENE, out=tmp_path / "run", **JOB, wanted_yield=0.8)
    beside = run.folder / "ideal"
    larger, found = (
        read_design(beside / "design.json", SCENE),
        json.loads((run.folder / "verification.json").read_text()),
    )
    stated = found["yield"]["ideal"]
    assert stated["area_ratio"] == pytest.approx(larger.area_ratio_in(SCENE.design), rel=1e-6)
    assert stated["area_ratio"] > run.record["area_ratio"] and stated["trains"] == 10
    assert stated["share"] <= found["yield"]["share"]
    assert read_cam(beside / "lift.csv", SCENE).area == pytest.approx(larger.area, rel=1e-4)
    assert read_design(run.folder / "design.json", SCENE).area < larger.area  # what is ground is the other one
    assert any("lies in ideal/" in line for line in outcome_lines(read_run_folder(run.folder)))
    assert "for the train as designed" in (run.folder / "figures" / "profiles.svg").read_text()


def test_the_ideal_cam_is_searched_as_the_run_says(monkeypatch, tmp_path):
    asked = {}

    def none(*arguments, **how):
        asked.update(how)
        raise NoCamFound("none")

    monkeypatch.setattr(statement, "find_cam", none)
    settings = {"speeds": "band", "accuracy": "draft", "gradient": "exact", "seed": 3}
    start = polydyne(SCENE)
    assert statement.write_ideal(SCENE, settings, tmp_path, start) is None
    assert asked == {"start": start, "seed": 3}


def test_an_interrupted_statement_leaves_a_whole_run_and_goes_on(interrupted, resumed):
    for name in ("scene.toml", "design.json", "lift.csv", "verification.json", "provenance.json"):
        assert (interrupted / name).stat().st_size > 0
    assert json.loads((interrupted / "verification.json").read_text())["verdict"] == "confirmed"
    run, judged = resumed
    assert judged == list(range(2 * CHUNK, run.as_built.share.trains))
    assert run.as_built.as_dict() == statement_of_run(SCENE, run.lift, SETTINGS, None).as_dict()


def test_no_train_is_judged_twice(job, tmp_path, monkeypatch):
    shutil.copy(job.folder / statement.JOURNAL, tmp_path)
    monkeypatch.setattr(statement.Looks, "ends", lambda self, holding, trains: trains >= self.trains[-1])
    with noted_trains() as judged:
        stated = statement_of_run(SCENE, job.lift, SETTINGS, tmp_path)
        assert judged == list(range(job.as_built.share.trains, 200)) and stated is not None
        assert stated.share.trains == 200
        assert statement_of_run(SCENE, job.lift, SETTINGS, tmp_path).as_dict() == stated.as_dict()
        assert judged == list(range(job.as_built.share.trains, 200))


def test_nothing_is_stated_where_nothing_scatters_or_is_limited(job):
    assert statement_of_run(parse_scene(EXAMPLE, "mine.toml"), job.lift, SETTINGS, None) is None
    limits = ("bounce_max_mm", "jump_max_mm", "seating_velocity_max_m_per_s", "contact_force_max_N")
    without = SCENE.model_copy(update={"design": SCENE.design.model_copy(update=dict.fromkeys(limits))})
    assert statement_of_run(without, job.lift, SETTINGS, None) is None


def test_as_many_trains_are_drawn_as_the_accuracy_and_the_share_call_for():
    kodama, hertz = load_scene("kodama"), load_scene("kodama-hertz")
    assert looks_of(ACCURACIES["draft"], kodama, None) == Looks((100, 200), 0.95)
    assert looks_of(ACCURACIES["standard"], kodama, 0.95) == Looks((150, 500, 625, 750, 875, 1000), 0.95)
    assert looks_of(ACCURACIES["fine"], kodama, 0.95).trains[-1] == 4000
    assert looks_of(ACCURACIES["standard"], hertz, None).trains == (38, 150, 500, 625, 750, 875, 1000)


def test_short_motions_judge_trains_as_those_of_full_length_do(monkeypatch):
    """Of the cam half of the trains hold, and many motions at the top of the band wander: of these the side of the
    limits is the same, of those that repeat themselves the figure."""
    scene = load_scene("kodama")
    program, _ = free_program(scene)
    lift = program.solve_below(np.full((3, 2), 50.0)).lift
    way = measured.track(scene, lift, np.linspace(5000.0, 7000.0, 5))
    drawn, lengths, settled = trains_as_built(scene, 24), [], measured.settled_metrics
    repeats = {}

    def noted(trains, lifts, speeds, **how):
        lengths.append((len(speeds), "most" in how))
        found = settled(trains, lifts, speeds, **how)
        if len(speeds) == 5:
            repeats[id(trains[0])] = found.periodic[0, 0]
        return found

    monkeypatch.setattr(measured, "settled_metrics", noted)
    used = way.used(drawn)
    again = sum(count for count, short in lengths if not short)
    assert sum(count for count, short in lengths if short) == 24 * 5 and 0 < again < 24
    assert measured.short_motions(way.limits.values())["tolerance"] > 1.0  # the short motions settle less far
    monkeypatch.setattr(measured, "short_motions", lambda limits: {})
    at_length = way.used(drawn)
    breaks, broken = (parts.max(axis=1) > 1.0 for parts in (used, at_length))  # a train that breaks one limit is judged
    assert np.array_equal(breaks, broken) and 6 < np.sum(~breaks.any(axis=1)) < 18
    near = (at_length > 1 / IRREGULAR) & (at_length < IRREGULAR)
    near &= np.array([repeats[id(one.train)] for one in drawn])[:, None]
    assert near.sum() > 5 and used[near] == pytest.approx(at_length[near], rel=1e-3)


def test_an_independent_method_differs_in_no_verdict(job, of_polydyne):
    """Trains at the speed at which each uses most of its limits, next to the limits and at random."""
    drawn, seen = trains_as_built(SCENE, 100), set()
    for lift, used in ((job.lift, job.as_built.used), (polydyne(SCENE), of_polydyne[0].used)):
        for t in dict.fromkeys([*sampled(used.worst, 5), 1, 2]):
            entry = by_independent_methods(drawn[t], lift, used, t)
            assert entry["agrees"], entry
            seen.add(entry["verdict"])
    assert {"confirmed", "rejected"} <= seen
    wrong = UsedLimits(used.limits, used.speeds_rpm, 0.5 * used.used / used.worst[:, None, None])
    t = int(np.argmax(used.worst))
    assert entry["verdict"] == "rejected" and not by_independent_methods(drawn[t], lift, wrong, t)["agrees"]


RECORD = {"share": 0.96, "low": 0.94, "high": 0.97, "trains": 500, "speeds_rpm": [5000.0, 7000.0]}


@pytest.mark.parametrize(
    ("more", "stands", "says"),
    [
        ({"wanted": None, "confirmed": None}, NOT_ASKED, "no yield was requested"),
        ({"wanted": None, "low": 0.95}, ENOUGH, "no yield was requested, and 95 % hold in any case"),
        ({"wanted": 0.95, "confirmed": True}, HELD, "yield of 95 %: confirmed"),
        (
            {"wanted": 0.97, "confirmed": False, "reasons": ["fewer trains hold", "methods disagree"]},
            MISSED,
            "yield of 97 %: not confirmed, because fewer trains hold and methods disagree",
        ),
        ({"share": None}, "", ""),
    ],
)
def test_how_a_share_stands_to_what_was_asked(more, stands, says):
    record = RECORD | more
    assert standing(record) == stands and asked_sentence(record) == says
    found = share_sentence(record)
    assert (found == stands and not found) or found.startswith("480 of 500 trains hold every limit on the motion at 2")


def test_more_trains_are_sampled_from_both_sides_of_the_limit():
    worst = np.array([0.2, 1.5, 0.9, 1.1, 0.7, 3.0])
    assert sampled(worst, 5) == [2, 4, 3, 1, 0] and sampled(worst, 0) == []


def test_a_journal_of_another_cam_counts_for_nothing(of_polydyne):
    stated, judged = of_polydyne
    assert judged == list(range(stated.share.trains))
