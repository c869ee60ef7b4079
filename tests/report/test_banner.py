"""The banner's two lines, the warnings, and the next steps of a run with a statement on trains as built."""

from dataclasses import replace

import pytest

from camopt.report.advice import advice
from camopt.report.folder import read_run_folder
from camopt.report.outcome import edge_sentences, outcome_lines, outcome_rows, yield_sentences
from camopt.report.page import banner
from tests.report.conftest import EVIL_TITLE
from tests.report.test_report_page import page_of

BUILT = {
    "wanted": None, "confirmed": None, "reasons": [], "share": 0.3333, "low": 0.27, "high": 0.4, "trains": 150,
    "seed": 0, "speeds_rpm": [5000.0, 6000.0, 7000.0], "independent": [], "baselines": {},
    "blame": {"spring rate": 0.4, "lash": 0.001},
    "first_broken": {"jump_max_mm": {"trains": 100, "speeds_rpm": {"6000": 10, "7000": 90}}}, "unexplained": 0.6,
}  # fmt: skip
ASKED = {"wanted": 0.95, "share": 0.96, "low": 0.945, "high": 0.975, "trains": 1000}


def run_of(write, contents, built: dict | None):
    if built is not None:
        contents["verification"]["yield"] = BUILT | built
    return read_run_folder(write(contents))


@pytest.mark.parametrize(
    ("verdict", "built", "kind", "words"),
    [
        ("confirmed", {}, "doubt", "No yield was requested."),
        ("confirmed", {"share": 0.99, "low": 0.97, "high": 1.0}, "good", "95 % hold in any case."),
        ("confirmed", ASKED | {"confirmed": True}, "good", "Yield of 95 %: confirmed."),
        ("confirmed", ASKED | {"confirmed": False, "reasons": ["few hold"]}, "bad", "because few hold."),
        ("sensitive", ASKED | {"confirmed": True}, "doubt", "Yield of 95 %: confirmed."),
        ("rejected", ASKED | {"confirmed": True}, "bad", "Yield of 95 %: confirmed."),
        ("confirmed", None, "doubt", "This run states no yield."),
        ("confirmed", {"share": "a lot"}, "doubt", "This run states no yield."),
    ],
)  # fmt: skip
def test_the_banner_is_green_only_if_verdict_and_yield_are(write, contents, verdict, built, kind, words):
    contents["verification"]["verdict"] = verdict
    run = run_of(write, contents, built)
    content = banner(run)
    assert [line["which"] for line in content["lines"]] == ["as designed", "as built"]
    assert content["kind"] == kind and content["lines"][1]["meaning"].endswith(words)
    (said,) = (line for line in outcome_lines(run) if line.startswith("as built: "))
    assert said.lower().endswith(words.rstrip(".").lower())


def test_a_scene_that_does_not_say_how_trains_differ_has_no_green_banner(write, contents):
    run = run_of(write, contents, None)
    run = replace(run, scene={key: value for key, value in run.scene.items() if key not in ("tolerance", "grinding")})
    content = banner(run)
    assert content["kind"] == "doubt" and "does not say how trains differ" in content["lines"][1]["meaning"]
    assert advice(run, "kodama", "run")[0]["words"].endswith("the scene does not say how trains differ.")


def test_the_page_and_the_table_state_the_share(write, contents):
    run = run_of(write, contents, {})
    row = outcome_rows(run)[-1]
    assert (row["label"], row["end"], row["where"]) == ("trains as built that hold", "33.3", "27 to 40 of 150 trains")
    assert row["source"] == "verification.json yield.share"
    first, blame = yield_sentences(run)
    assert first == "breaks first: jump_max_mm in 100 trains, most often at 7000 r/min"
    assert blame.endswith("spring rate 40 %; 60 % unexplained")
    page = page_of(write(contents))
    assert "50 of 150 trains hold every limit on the motion at 3 speeds from 5000 to 7000 r/min: 33.3 %" in page.text
    assert page.text.index("50 of 150") < page.text.index("What to do next") and first in page.text


def test_content_of_the_file_is_escaped_and_checked(write, contents):
    run_of(write, contents, {"reasons": [EVIL_TITLE], "wanted": 0.9, "confirmed": False, "blame": {EVIL_TITLE: 0.5}})
    contents["verification"]["yield"] |= {"first_broken": {EVIL_TITLE: {"trains": 3, "speeds_rpm": {EVIL_TITLE: 3}}}}
    assert EVIL_TITLE in page_of(write(contents)).text
    for broken in ({"first_broken": [1]}, {"blame": "x"}, {"speeds_rpm": None}, {"reasons": 3}, {"baselines": [2]}):
        contents["verification"]["yield"] = BUILT | broken
        assert "33.3 % of trains" in page_of(write(contents)).text


def test_each_warning_has_a_sentence(write, contents):
    for record in (*contents["verification"]["speeds"], *contents["verification"]["worst_in_band"]):
        record |= {"jump_deg": 39.2, "ranges": {}, "periodic": record["speed_rpm"] != 7000}
    narrow, opened, wanders = edge_sentences(run_of(write, contents, {}))
    assert narrow == (
        "The limits hold only 0.86 % beyond the band's top speed, which a spring 1.7 % softer uses up: a higher "
        "band_rpm, or --yield, gives a reserve."
    )
    assert opened.startswith("A contact is open over 39.2 deg of the cam at") and "contact_force_min_N" in opened
    assert wanders.startswith("The motion at 7000 r/min does not settle") and wanders.endswith("--yield, calms it.")
    text = page_of(write(contents)).text
    assert "Knife's edge" in text and narrow in text and wanders in text


def test_a_confirmed_yield_replaces_the_warning_on_the_speed_reserve(write, contents):
    for record in (*contents["verification"]["speeds"], *contents["verification"]["worst_in_band"]):
        record |= {"periodic": record["speed_rpm"] != 7000}
    (wanders,) = edge_sentences(run_of(write, contents, ASKED | {"confirmed": True}))
    assert wanders.startswith("The motion at 7000 r/min") and "--yield" not in wanders
    assert len(edge_sentences(run_of(write, contents, ASKED | {"confirmed": False}))) == 2


def test_there_is_no_warning_without_a_cause(write, contents):
    contents["verification"]["limits"] |= {"first_jump_rpm": 7300}
    run = run_of(write, contents, {})
    assert edge_sentences(run) == []
    assert "Knife's edge" not in page_of(write(contents)).text
    contents["verification"] |= {"verdict": "rejected", "limits": {"first_jump_rpm": 7010, "first_bounce_rpm": None}}
    assert edge_sentences(read_run_folder(write(contents))) == []  # the verdict says worse
    limited = {"design": run.scene["design"] | {"jump_max_deg": 50.0}}
    for record in run.verification["worst_in_band"]:
        record |= {"jump_deg": 39.2, "ranges": {}}
    assert len(edge_sentences(run)) == 1 and edge_sentences(replace(run, scene=run.scene | limited)) == []
