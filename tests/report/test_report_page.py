import json
import re
from html.parser import HTMLParser

import pytest

from camopt.report import write_report
from camopt.scene.errors import InputError
from camopt.verifier.record import outside_entry

VOID = {"meta", "link", "br", "img", "hr", "input"}


class Page(HTMLParser):
    """The text of a page, its tables, its elements and its attributes."""

    def __init__(self, text: str):
        super().__init__()
        self.words, self.tables, self.elements, self.attributes, self.open = [], [], [], [], []
        self.feed(text)
        assert not self.open, f"elements left open: {self.open}"
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes += attributes
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_startendtag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes += attributes

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" in self.open:
            return
        self.words.append(data)
        if "td" in self.open or "th" in self.open:
            self.tables[-1][-1][-1] += data

    def table(self, first_heading: str) -> dict[str, dict[str, str]]:
        """Rows of the first table with this first heading, by their first cell and column."""
        for heads, *rows in self.tables:
            if heads and heads[0] == first_heading:
                return {row[0]: dict(zip(heads, row, strict=True)) for row in rows}
        raise AssertionError(f"no table begins with {first_heading!r}")


def page_of(folder) -> Page:
    return Page(write_report(folder).read_text(encoding="utf-8"))


@pytest.fixture
def page(write, contents) -> Page:
    """The page of the unchanged run folder."""
    return page_of(write(contents))


def test_verdict_comes_first_in_words(page):
    assert page.text.index("Confirmed") < page.text.index("Limits")
    for sentence in (
        "every limit holds at the upper end of its range",
        "Area ratio 0.5618, 9.23 % below the certified bound 0.6189.",
        "Largest bounce over 5000 to 7000 r/min in steps of 20 r/min: 0.0413 mm, at 6980 r/min.",
        "Jump exceeds 0.05 mm from 7060 r/min on, 0.9 % above the band.",
        "Bounce does not exceed 0.05 mm below 1.5 times the band's top.",
        "Asked for: standard.",
        "Delivered: estimated error of bounce: 0.08 um.",
    ):
        assert sentence in page.text
    assert "is not in the run folder" not in page.text and "Contradiction" not in page.text


@pytest.mark.parametrize("verdict", ["rejected", "sensitive", "not converged"])
def test_other_verdicts_are_not_green(write, contents, verdict):
    contents["verification"] |= {"verdict": verdict, "broken": ["bounce_mm"]}
    page = page_of(write(contents))
    kinds = [value for key, value in page.attributes if key == "class" and value.startswith("verdict ")]
    assert kinds == ["verdict bad" if verdict == "rejected" else "verdict doubt"]
    assert verdict.capitalize() in page.text and "Broken: bounce." in page.text


def said_from_outside(speed_rpm: float, difference_nm: float) -> dict:
    return outside_entry(speed_rpm, "Exudyn 1", 2, difference_nm, 1.1)


def test_an_external_result_has_a_column_and_a_sentence(write, contents):
    folder = write(contents)
    assert "from outside" not in page_of(folder).text
    (folder / "outside.json").write_text(json.dumps([said_from_outside(5000, 0.25)]), encoding="utf-8")
    page = page_of(folder)
    assert "difference to Exudyn [nm]" in page.text
    assert "Exudyn 1 agrees within 0.25 nm at 1 speed, by the valve's motion from rest." in page.text
    assert page.text.index("Confirmed") < page.text.index("Limits")


def test_an_external_result_that_disagrees_changes_the_verdict(write, contents):
    folder = write(contents)
    entries = [said_from_outside(5000, 0.25), said_from_outside(6000, 2.5)]
    (folder / "outside.json").write_text(json.dumps(entries), encoding="utf-8")
    page = page_of(folder)
    assert [v for k, v in page.attributes if k == "class" and v.startswith("verdict ")] == ["verdict doubt"]
    assert "Not converged" in page.text and "Exudyn 1 disagrees at 6000 r/min" in page.text


def test_without_a_band_nothing_is_said_about_floating(write, contents):
    contents["verification"] |= {"band": None, "limits": {"first_jump_rpm": None, "first_bounce_rpm": None}}
    text = page_of(write(contents)).text
    assert "does not exceed" not in text  # null: not computed
    assert "Verified at 5000, 6000, 6500 and 7000 r/min and at no speed between" in text


def test_worth_of_limits_where_the_run_recorded_it(write, contents):
    assert "This run recorded it for no limit that its cam reaches" in page_of(write(contents)).text
    contents["design"]["limit_worth"] = {"max_lift_mm": 0.1234, "jerk_max_mm_per_deg3": 0.25, EVIL: 0.01}
    page = page_of(write(contents))
    table = next(t for t in page.tables if "worth [% of area per %]" in t[0])
    assert table[1:3] == [["jerk max", "0.25"], ["max lift", "0.123"]] and "script" not in page.elements
    contents["design"]["highest_lift_mm"] = 9.0  # a higher limit does not change a lift below it
    table = next(t for t in page_of(write(contents)).tables if "worth [% of area per %]" in t[0])
    assert len(table) == 3 and table[1] == ["jerk max", "0.25"]


def test_limits_show_the_worst_at_its_speed(page):
    limits = page.table("limit")
    assert limits["jerk max"]["reached"] == "0.003" and limits["jerk max"]["state"] == "✓ held"
    assert limits["acceleration min"]["demanded"] == "at least −0.008"
    assert limits["bounce"] == {"limit": "bounce", "state": "✓ held", "reached": "0.0413", "demanded": "at most 0.05",
                                "unit": "mm", "where": "at 6980 r/min"}  # fmt: skip
    assert limits["jump"]["reached"] == "0.039" and limits["jump"]["where"] == "at 7000 r/min"
    assert limits["seating velocity"]["reached"] == "0.3"


@pytest.mark.parametrize(
    ("at", "changes", "state", "reached", "where"),
    [
        (2, {"ranges": {"bounce_mm": [0.01, 0.0501]}}, "✗ broken", "0.0501", "at 6500 r/min"),
        (3, {"bounce_mm": 0.0499, "bounce_error_mm": 2e-4, "bounce_range_mm": None, "ranges": None},
         "✗ broken", "0.0501", "at 7000 r/min"),
        (3, {"bounce_mm": None, "bounce_range_mm": None, "ranges": None},
         "? not known", "–", "no figure at 7000 r/min"),
    ],
    ids=["the upper end of the range", "without a range the error is added", "never seats"],
)  # fmt: skip
def test_the_bounce_is_judged_at_the_upper_end_of_its_range(write, contents, at, changes, state, reached, where):
    contents["verification"]["speeds"][at] |= changes
    page = page_of(write(contents))
    row = page.table("limit")["bounce"]
    assert (row["state"], row["reached"], row["where"]) == (state, reached, where)
    broken = state == "✗ broken"
    assert ("Contradiction" in page.text and "exceed these limits: bounce" in page.text) is broken
    assert (page.table("speed [r/min]")["7000"]["bounce [mm]"] == "never seats") is not broken


def test_a_deceleration_below_its_limit_is_broken(write, contents):
    for row in contents["comparison"]:
        row["acceleration_min_mm_per_deg2"] = -0.0081
    page = page_of(write(contents))
    assert page.table("limit")["acceleration min"]["state"] == "✗ broken"
    assert page.table("limit")["acceleration max"]["state"] == "✓ held"


def test_start_and_end_are_in_physical_units(page):
    rows = page.table("figure")
    assert rows["area ratio"] == {"figure": "area ratio", "unit": "–", "start": "0.5274 →", "end": "0.5618",
                                  "limit": "–", "where": "–"}  # fmt: skip
    assert rows["worst bounce"] == {"figure": "worst bounce", "unit": "mm", "start": "0.221 →", "end": "0.0413",
                                    "limit": "at most 0.05", "where": "at 6980 r/min"}  # fmt: skip


def test_areas_stand_against_the_certified_bound(write, contents):
    for row in contents["comparison"]:
        row["cam"] = row["cam"].replace("multi-pol", "multi-pol (no jerk limit)")  # as `compare` names it
    within, beyond = (t for t in page_of(write(contents)).tables if t[0][:2] == ["cam", "area ratio"])
    rows = {row[0]: dict(zip(within[0], row, strict=True)) for row in within[1:]}
    assert list(rows) == ["design", "certified bound", "no-jump linear program", "polydyne"]
    assert [row[:3] for row in beyond[1:]] == [["multi-pol (without the jerk limit)", "0.6021", "–"]]
    assert rows["polydyne"]["area ratio"] == "0.5434" and rows["polydyne"]["of the bound"] == "87.8 %"
    assert rows["design"]["verdict"] == "confirmed" and rows["polydyne"]["verdict"] == "rejected"


def test_comparison_keeps_cams_without_jerk_limit_apart(page):
    first, second = (t for t in page.tables if "worst bounce [mm]" in t[0])
    assert [row[0] for row in first[1:]] == ["design", "polydyne"] and [row[0] for row in second[1:]] == ["multi-pol"]
    assert first[2][1:4] == ["rejected", "0.5434", "0.495"] and first[2][-1] == "bounce"
    assert first[1][-1] == "–"
    assert len(next(t for t in page.tables if "bounce high [mm]" in t[0])) == 1 + 12


def test_methods_stand_side_by_side_with_their_difference(page):
    tables = [t for t in page.tables if t[0][-1] == "largest difference"]
    assert len(tables) == 4
    assert tables[3][0] == [
        "figure", "event-exact", "Runge-Kutta-Gill", "transition matrix", "Houbolt", "largest difference"
    ]  # fmt: skip
    rows = {row[0]: row[1:] for row in tables[3][1:]}
    assert rows["bounce [mm]"] == ["0.033", "0.033003", "0.033007", "0.03301", "9.9e−06"]
    assert rows["steps per revolution"] == ["400", "28800", "57600", "86400", "–"]
    assert rows["converged"] == ["yes"] * 4 + ["–"]


def test_provenance_is_complete(page):
    rows = {row[0]: row[1] for row in page.tables[-1]}
    assert rows["versions.jax"] == "0.10.2" and rows["seed"] == "7" and rows["times.total_s"] == "212.5"


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        ("verification.json", "verification.json is not in the run folder"),
        ("design.json", "design.json is not in the run folder"),
        ("comparison.csv", "no other cam was compared"),
        ("history.jsonl", "where the search began is not known"),
        ("provenance.json", "versions, seed, settings and times are not known"),
        ("scene.toml", "its limits are not known here"),
        ("figures/convergence.svg", "holds no figures"),
    ],
)
def test_a_missing_file_is_named(write, contents, file, sentence):
    folder = write(contents)
    (folder / file).unlink()
    page = page_of(folder)
    assert sentence in page.text
    if file == "verification.json":
        assert "Not verified" in page.text and "Confirmed" not in page.text


def test_an_empty_folder_still_gives_a_page(tmp_path):
    page = page_of(tmp_path)
    assert "Not verified" in page.text and page.text.count("is not in the run folder") == 6


def test_an_incomplete_last_line_of_the_history_is_dropped(write, contents):
    folder = write(contents)
    with open(folder / "history.jsonl", "a", encoding="utf-8") as file:
        file.write('{"stage": "marg')
    assert page_of(folder).table("figure")["area ratio"]["start"] == "0.5274 →"


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("design.json", "{"),
        ("design.json", "[1]"),
        ("verification.json", '{"speeds": 3}'),
        ("verification.json", '{"speeds": [{"methods": [1]}]}'),
        ("verification.json", '{"band": 3}'),
        ("verification.json", '{"verdict": ["confirmed"]}'),
        ("comparison.csv", "a,b\n1,2\n"),
        ("history.jsonl", "{}\nnonsense\n{}\n"),
        ("scene.toml", "= 3"),
    ],
)
def test_a_malformed_file_is_named_and_the_old_report_stays(write, contents, file, text):
    folder = write(contents)
    before = write_report(folder).read_bytes()
    (folder / file).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(file)):
        write_report(folder)
    assert (folder / "report.html").read_bytes() == before


def test_no_folder_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="no such run folder"):
        write_report(tmp_path / "nowhere")


def test_the_same_folder_gives_the_same_page(write, contents):
    folder = write(contents)
    assert write_report(folder).read_bytes() == write_report(folder).read_bytes()


EVIL = "<script>alert(1)</script><img src=x onerror=alert(1)>\"'"


def test_texts_of_the_folder_are_escaped(write, contents):
    contents["design"]["family"] = EVIL
    contents["verification"] |= {"verdict": EVIL, "broken": [EVIL]}
    contents["verification"]["speeds"][0] |= {"verdict": EVIL, "speed_rpm": EVIL}
    contents["verification"]["speeds"][0]["methods"][EVIL] = {"bounce_mm": EVIL}
    contents["provenance"][EVIL] = EVIL
    contents["history"][0][EVIL] = 1.0
    for row in contents["comparison"]:
        row["cam"], row["limits"], row["verdict"], row["broken"] = EVIL, EVIL, EVIL, EVIL
    page = page_of(write(contents))
    assert page.text.count("<script>alert(1)</script>") > 10  # as text
    assert not {"script", "iframe", "object", "link"} & set(page.elements)
    assert all(value.startswith("data:image/svg+xml;base64,") for key, value in page.attributes if key == "src")
    assert not [key for key, _ in page.attributes if key.startswith("on")]


def test_the_page_needs_nothing_from_outside(page):
    policy = dict(page.attributes)["http-equiv"], [v for k, v in page.attributes if k == "content"]
    assert policy[0] == "Content-Security-Policy"
    assert "default-src 'none'; style-src 'unsafe-inline'; img-src data:" in policy[1]
    targets = [value for key, value in page.attributes if key in ("src", "href", "xlink:href", "action", "data")]
    assert targets and all(value.startswith(("#", "data:image/svg+xml;base64,")) for value in targets)
    assert page.elements.count("img") == 1


def test_known_figures_come_in_the_pages_order(write, contents):
    folder = write(contents)
    for name in ("zeta", "profiles", "alpha"):
        (folder / "figures" / f"{name}.svg").write_text("<svg/>")
    words = page_of(folder).text
    places = [words.index(title) for title in ("dashed lines are the limits", "only filled steps", "alpha.", "zeta.")]
    assert places == sorted(places)
