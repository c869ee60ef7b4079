"""Every number that is stated about a verdict comes from verification.json, for a confirmed and for a rejected cam."""

import json

import pytest

from camopt.report.folder import read_run_folder
from camopt.report.outcome import outcome_lines
from tests.report.test_report_page import page_of

WORSE_BELOW = {"contact_force_min_N"}
LABELS = {
    "bounce_mm": "worst bounce",
    "jump_mm": "worst jump",
    "jump_deg": "worst jump angle",
    "contact_force_min_N": "least contact force",
    "contact_force_max_N": "worst peak contact force",
    "seating_velocity_m_per_s": "worst seating velocity",
}
LIMITED = {"bounce": "bounce_mm", "jump": "jump_mm", "seating velocity": "seating_velocity_m_per_s",
           "peak contact force": "contact_force_max_N"}  # fmt: skip


def rejected_between(contents: dict) -> dict:
    """The contents for a cam that is confirmed at every listed speed but rejected for its jump at a speed between."""
    verification, jump_mm, speed_rpm = contents["verification"], 0.2, 6990.0
    record = {**verification["speeds"][3], "speed_rpm": speed_rpm, "verdict": "rejected", "jump_mm": jump_mm}
    record["ranges"] = record["ranges"] | {"jump_mm": [0.9 * jump_mm, jump_mm]}
    verification |= {"verdict": "rejected", "broken": [f"jump_max_mm at {speed_rpm:g} r/min"]}
    verification["worst_in_band"] = [record]
    verification["band"]["worst"]["jump_mm"] |= {"value": jump_mm, "speed_rpm": speed_rpm}
    return contents


def expected(verification: dict, name: str) -> tuple[float, float]:
    """The worst value of a metric in verification.json and its speed, read without camopt's functions."""
    pairs = [(verification["band"]["worst"][name]["value"], verification["band"]["worst"][name]["speed_rpm"])]
    for speed in verification["speeds"] + verification["worst_in_band"]:
        value = (min if name in WORSE_BELOW else max)(speed["ranges"][name])
        pairs.append((value, speed["speed_rpm"]))
    return (min if name in WORSE_BELOW else max)(pairs, key=lambda pair: pair[0])


def printed_table(folder) -> dict[str, list[str]]:
    """Rows of the printed table: label -> the words after it."""
    rows = {}
    for line in outcome_lines(read_run_folder(folder))[1:]:
        rows[line[:28].strip()] = line[28:].split()
    return rows


def same(text: str, value: float) -> bool:
    """Whether a printed number is this value, to half a unit of the fourth of its digits."""
    return float(text.replace("−", "-")) == pytest.approx(value, rel=5e-4)


def states_what_verification_says(folder) -> None:
    """Assert that the page and the printed table state the worst values of verification.json to their digits."""
    verification = json.loads((folder / "verification.json").read_text())
    page, printed = page_of(folder), printed_table(folder)
    table, limits = page.table("figure"), page.table("limit")
    for name, label in LABELS.items():
        value, speed = expected(verification, name)
        assert same(table[label]["end"], value) and table[label]["where"] == f"at {speed:g} r/min"
        assert same(printed[label][3], value) and f"at {speed:g} r/min" in " ".join(printed[label])
    for label, name in LIMITED.items():
        if label in limits:
            value, speed = expected(verification, name)
            assert same(limits[label]["reached"], value) and limits[label]["where"] == f"at {speed:g} r/min"
    for name, row in zip(verification["band"]["worst"], page.table("over the band").values(), strict=True):
        worst = verification["band"]["worst"][name]
        assert same(row["worst"], worst["value"]) and row["at [r/min]"] == f"{worst['speed_rpm']:g}"


@pytest.mark.parametrize("rejected", [False, True])
@pytest.mark.parametrize("name", LABELS)
@pytest.mark.parametrize("place", ["band.worst", "worst_in_band", "speeds"])
def test_a_number_changed_in_verification_changes_everywhere(write, contents, rejected, name, place):
    verification = (rejected_between(contents) if rejected else contents)["verification"]
    far = -12.345 if name in WORSE_BELOW else 12345.0
    if place == "band.worst":
        verification["band"]["worst"][name]["value"] = far
    else:
        verification[place][0][name] = far
        verification[place][0]["ranges"][name] = [far, far]
    folder = write(contents)
    states_what_verification_says(folder)
    assert same(page_of(folder).table("figure")[LABELS[name]]["end"], far)


def test_values_of_the_comparison_do_not_replace_the_verdict(write, contents):
    before = outcome_lines(read_run_folder(write(contents)))
    for row in contents["comparison"]:
        row |= {"jump_mm": 77.0, "bounce_mm": 77.0, "bounce_high_mm": 77.0, "seating_velocity_m_per_s": 77.0}
    folder = write(contents)
    assert outcome_lines(read_run_folder(folder)) == before
    page = page_of(folder)
    assert not [row for row in page.table("limit").values() if row["reached"] == "77"]
    first = next(t for t in page.tables if "worst bounce [mm]" in t[0])
    assert "77" not in first[1] and first[1][0] == "design"  # the design's row is the verdict's


def test_a_cam_that_only_the_band_rejects_shows_what_broke(write, contents):
    page = page_of(write(rejected_between(contents)))
    row = page.table("limit")["jump"]
    assert (row["state"], row["reached"], row["where"]) == ("✗ broken", "0.2", "at 6990 r/min")
    assert "Broken: jump at 6990 r/min." in page.text and "Contradiction" not in page.text
    assert page.table("speed [r/min]")["6990"]["chosen as"] == "worst of the band"


@pytest.mark.parametrize(
    ("verdict", "broken", "at_speeds", "sentence"),
    [
        ("rejected", ["jump_max_mm at 6990 r/min"], {}, "The verdict says that the limit on jump is broken, yet by the "
         "figures below it is held."),
        ("rejected", [], {}, "The verdict is rejected, yet it names no limit that is broken."),
        ("sensitive", [], {"worst_in_band": "not converged"}, "The verdict is sensitive, yet at 7000 r/min it is not "
         "converged."),
        ("confirmed", [], {"speeds": "sensitive"}, "The verdict is confirmed, yet at 5000 r/min it is sensitive."),
    ],
)  # fmt: skip
def test_contradictions_are_seen(write, contents, verdict, broken, at_speeds, sentence):
    contents["verification"] |= {"verdict": verdict, "broken": broken}
    for key, word in at_speeds.items():
        contents["verification"][key][0]["verdict"] = word
    assert f"Contradiction: {sentence}" in page_of(write(contents)).text


def test_a_broken_condition_outside_the_table_has_a_row(write, contents):
    verification = contents["verification"]
    verification |= {"verdict": "rejected", "broken": ["nose_deg", "never seats at 7000 r/min", "jerk_max_mm_per_deg3"]}
    limits = page_of(write(contents)).table("limit")
    assert limits["nose"]["state"] == limits["never seats"]["state"] == limits["jerk max"]["state"] == "✗ broken"
    assert limits["never seats"]["where"] == "at 7000 r/min"


def test_a_band_without_its_worst_is_not_called_held(write, contents):
    del contents["verification"]["band"]["worst"]
    page = page_of(write(contents))
    assert page.table("limit")["jump"]["state"] == "? not known"


def test_floating_is_stated_in_words_and_in_the_table(write, contents):
    worst = contents["verification"]["band"]["worst"]
    worst["jump_deg"] |= {"value": 76.2, "speed_rpm": 6960}
    worst["contact_force_min_N"] |= {"value": 0.0, "speed_rpm": 6960}
    folder = write(contents)
    page = page_of(folder)
    sentence = (
        "A contact between cam and valve opens: jump 0.039 mm, at 7000 r/min; open over 76.2 of the event's 144 deg, "
        "at 6960 r/min; least contact force 0 N, at 6960 r/min."
    )
    assert sentence in page.text and page.text.index(sentence) < page.text.index("What was reached")
    assert printed_table(folder)["worst jump angle"][:5] == ["deg", "–", "->", "76.2", "at"]
    assert printed_table(folder)["least contact force"][:4] == ["N", "–", "->", "0"]


def test_limits_on_floating_are_shown_where_they_are_set(write, contents):
    folder = write(contents)
    text = (folder / "scene.toml").read_text(encoding="utf-8")
    further = "jump_max_deg = 5\ncontact_force_min_N = 10\nbounce_max_mm"
    (folder / "scene.toml").write_text(text.replace("bounce_max_mm", further, 1), encoding="utf-8")
    limits = page_of(folder).table("limit")
    angle, force = limits["jump angle"], limits["least contact force"]
    assert (angle["state"], angle["reached"], angle["demanded"]) == ("✓ held", "4.5", "at most 5")
    assert (force["state"], force["reached"], force["demanded"]) == ("✗ broken", "5", "at least 10")
    assert printed_table(folder)["least contact force"][4:7] == ["at", "least", "10"]
    assert printed_table(folder)["worst jump angle"][4:7] == ["at", "most", "5"]


def test_a_contact_that_stays_closed_is_reported(write, contents):
    verification = contents["verification"]
    for record in (*verification["speeds"], *verification["worst_in_band"]):
        record |= {"jump_mm": 0.0, "jump_deg": 0.0, "contact_force_min_N": 41.5, "ranges": {}}
    for name, value in (("jump_mm", 0.0), ("jump_deg", 0.0), ("contact_force_min_N", 35.25)):
        verification["band"]["worst"][name] |= {"value": value, "speed_rpm": 6900}
    sentence = "No contact between cam and valve opens: its least force is 35.25 N, at 6900 r/min."
    assert sentence in page_of(write(contents)).text


FOLLOWED = "Adapting the margins to the judged motion gained 0.0041 of area ratio."


@pytest.mark.parametrize(
    ("gain", "back", "broken", "sentences"),
    [
        (0.0041, None, [], [FOLLOWED]),
        (0.0, None, [], [
            "The search judged 4 cams, none of them both larger than the no-jump program's and within the limits on "
            "the motion; others were not tried."]),
        (-0.0012, (2, 0.58652), [], [
            "The delivered cam has 0.0012 less area ratio than the no-jump program's cam.",
            "The 2 largest cams of the search were verified, and the last of them is delivered; the largest that was "
            "rejected has an area ratio of 0.58652."]),
        (0.0041, (1, None), [], [FOLLOWED]),
        (0.0041, (4, 0.586), ["bounce_max_mm at 7000 r/min"], [
            FOLLOWED,
            "The 4 largest cams of the search were verified, and all were rejected, because they break limits such as "
            "bounce at 7000 r/min; the largest has an area ratio of 0.586."]),
    ],
)  # fmt: skip
def test_the_gain_is_what_the_delivered_cam_gained(write, contents, gain, back, broken, sentences):
    contents["design"]["gradient_gain"] = gain
    contents["verification"] |= {"broken": broken, "verdict": "rejected" if broken else "confirmed"}
    contents["history"] += [{"stage": name, "area_ratio": 0.5} for name in ("margins fed back", "between two cams")]
    if back is not None:
        contents["design"]["verdict_fell_back"] = dict(
            zip(("candidates_judged", "largest_refused_area_ratio"), back, strict=True)
        )
    folder = write(contents)
    lines, text = outcome_lines(read_run_folder(folder)), page_of(folder).text
    assert [line for line in lines if "gained" in line or "cam" in line.split(":")[0]] == sentences
    assert all(sentence in text for sentence in sentences)


def test_an_error_estimate_has_no_meaningless_digits(write, contents):
    for record in (*contents["verification"]["speeds"], *contents["verification"]["worst_in_band"]):
        record["bounce_error_mm"] = 4.93e-11
    page = page_of(write(contents))
    assert page.table("speed [r/min]")["7000"]["error of it [µm]"] == "±0.01"
    assert "e−" not in " ".join(page.table("speed [r/min]")["7000"].values())


def test_an_accuracy_that_was_not_reached_is_stated(write, contents):
    contents["verification"]["accuracy"] = {
        "reached": False,
        "statement": "requested accuracy: 5 um; not reached: only a range of the bounce is known, 0.1 to 0.2 mm",
    }
    text = page_of(write(contents)).text
    assert "Delivered: not reached: only a range of the bounce is known, 0.1 to 0.2 mm." in text
