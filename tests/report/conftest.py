"""A small run folder with the keys of docs/run-folder.md, with values written by hand."""

import csv
import json
import re

import pytest

from camopt.cam.design_file import write_design
from camopt.cam.read import read_cam
from camopt.report import write_report
from camopt.scene import load_scene
from camopt.scene.load import scene_text
from camopt.scene.units import MM
from tests.browser import watched_pages

EVIL_TITLE = "</script><script>document.title='changed'</script>"

SPEEDS = (5000, 6000, 6500, 7000)
COLUMNS = (
    "cam,limits,speed_rpm,area_ratio,acceleration_max_mm_per_deg2,acceleration_min_mm_per_deg2,jerk_max_mm_per_deg3,"
    "bounce_mm,bounce_low_mm,bounce_high_mm,jump_mm,contact_force_min_N,seating_velocity_m_per_s,"
    "impact_velocity_m_per_s,verdict,broken"
).split(",")


def metrics(i: int, factor: float = 1.0) -> dict:
    return {
        "bounce_mm": 0.011 * i * factor,
        "jump_mm": 0.013 * i * factor,
        "jump_deg": 1.5 * i * factor,
        "contact_force_min_N": 20.0 - 5 * i,
        "contact_force_max_N": 1500.0 + 100 * i,
        "seating_velocity_m_per_s": 0.21 + 0.03 * i,
        "impact_velocity_m_per_s": 0.25 + 0.03 * i,
        "dynamic_area_mm_deg": 739.5 + i,
    }


def speed_record(i: int) -> dict:
    methods = {
        name: {**metrics(i, 1 + 1e-4 * k), "steps_per_revolution": 28800 * k or 400, "converged": True}
        for k, name in enumerate(("event", "rkg", "tmm", "houbolt"))
    }
    return {
        "speed_rpm": SPEEDS[i],
        "verdict": "confirmed",
        **metrics(i),
        "bounce_error_mm": 2e-5 * (i + 1),
        "bounce_range_mm": [0.010 * i, 0.012 * i],
        "ranges": {name: [value, value] for name, value in metrics(i).items()} | {"bounce_mm": [0.010 * i, 0.012 * i]},
        "revolutions": 6 + i,
        "periodic": True,
        "methods": methods,
    }


def band_record() -> dict:
    """The band of verification.json: the last listed speed is the worst for every metric except bounce."""
    last, worst_bounce_mm, worst_speed_rpm = metrics(len(SPEEDS) - 1), 0.0413, 6980
    worst = {name: {"value": value, "speed_rpm": SPEEDS[-1], "method": "event"} for name, value in last.items()}
    worst["bounce_mm"] = {"value": worst_bounce_mm, "speed_rpm": worst_speed_rpm, "method": "event"}
    worst["dynamic_area_mm_deg"] |= {"value": metrics(0)["dynamic_area_mm_deg"], "speed_rpm": SPEEDS[0]}
    speeds = sorted({*SPEEDS, worst_speed_rpm})
    curves = {name: [metrics(0)[name]] * len(speeds) for name in last}
    return {
        "from_rpm": 5000,
        "to_rpm": 7000,
        "step_rpm": 20,
        "worst_bounce_mm": worst_bounce_mm,
        "worst_speed_rpm": worst_speed_rpm,
        "worst": worst,
        "curves": {"speed_rpm": speeds, **curves},
    }


def comparison_row(cam: str, limits: str, i: int, area: float, jerk: float, bounce: float, verdict: str) -> dict:
    broken = "bounce_mm" if verdict == "rejected" else ""
    figures = (0.0149, -0.0079, jerk, bounce, 0.9 * bounce, 1.1 * bounce, 2 * bounce, 5.0, 0.3, 0.4)
    return dict(zip(COLUMNS, (cam, limits, SPEEDS[i], area, *figures, verdict, broken), strict=True))


def parts() -> dict:
    """The contents of every JSON and table file, which a test may change before they are written."""
    rows = []
    for i in range(4):
        rows.append(comparison_row("design", "all", i, 0.5618, 0.003, 0.011 * i, "confirmed"))
        rows.append(comparison_row("polydyne", "all", i, 0.5434, 0.00295, 0.15 * i, "rejected" if i else "confirmed"))
        rows.append(comparison_row("multi-pol", "no-jerk", i, 0.6021, 0.031, 0.4 * i, "rejected"))
    return {
        "design": {
            "family": "free",
            "parameters": {},
            "pieces": {"start_deg": [-180.0], "end_deg": [180.0], "coefficients_mm": [[0.0]]},
            "area_mm_deg": 760.5,
            "area_ratio": 0.5618,
            "area_ratio_bound": 0.6189,
            "area_gap_percent": 9.23,
            "area_ratio_no_jump": 0.5577,
            "gradient_gain": 0.0041,
        },
        "verification": {
            "verdict": "confirmed",
            "broken": [],
            "speeds": [speed_record(i) for i in range(4)],
            "worst_in_band": [speed_record(3)],
            "band": band_record(),
            "limits": {"first_jump_rpm": 7060, "first_bounce_rpm": None},
            "accuracy": {"statement": "requested accuracy: 1 um (standard); estimated error of bounce: 0.08 um"},
        },
        "comparison": rows,
        "provenance": {
            "versions": {"camopt": "0.1.0", "jax": "0.10.2", "numpy": "2.4.6"},
            "seed": 7,
            "settings": {"speeds": "band", "accuracy": "standard", "gradient": "exact"},
            "times": {"bound_s": 0.4, "total_s": 212.5},
        },
        "history": [
            {"stage": "no-jump program", "iteration": 0, "area_ratio": 0.5274, "worst_bounce_mm": 0.221},
            {"stage": "margins", "iteration": 1, "area_ratio": 0.5618, "worst_bounce_mm": 0.036},
        ],
    }


FIGURE = '<svg xmlns="http://www.w3.org/2000/svg" width="300" height="200"><path d="M9 9L290 190" stroke="#000"/></svg>'


def write_run(folder, data: dict, scene: str) -> None:
    """Writes contents, a built-in scene and a figure into a run folder."""
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    (folder / "figures" / "convergence.svg").write_text(FIGURE, encoding="utf-8")
    (folder / "scene.toml").write_text(scene_text(scene), encoding="utf-8")
    for name in ("design", "verification", "provenance"):
        (folder / f"{name}.json").write_text(json.dumps(data[name]), encoding="utf-8")
    with open(folder / "comparison.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(data["comparison"])
    lines = "".join(json.dumps(step) + "\n" for step in data["history"])
    (folder / "history.jsonl").write_text(lines, encoding="utf-8")


@pytest.fixture
def contents() -> dict:
    return parts()


@pytest.fixture
def write(tmp_path):
    """Function that writes a run folder with the given contents and returns its path."""

    def write_folder(data: dict, scene: str = "kodama"):
        folder = tmp_path / "kodama-run"
        write_run(folder, data, scene)
        return folder

    return write_folder


def write_cams(folder, lifts: dict, **further) -> None:
    """Adds the lifts of the design and of Polydyne to a run folder; `further` are values of the design."""
    (folder / "cams").mkdir()
    write_design(folder / "cams" / "polydyne.json", lifts["polydyne"], 9.4 * MM)
    write_design(folder / "design.json", lifts["design"], 9.4 * MM, **further)


def rows_of(rows: list[dict], lifts: dict) -> list[dict]:
    """The rows of the comparison that belong to given lifts, with the area ratios of these lifts."""
    return [row | {"area_ratio": lifts[row["cam"]].area_ratio(9.4 * MM)} for row in rows if row["cam"] in lifts]


@pytest.fixture(scope="session")
def lifts():
    scene = load_scene("kodama")
    return {
        "design": read_cam("polydyne:exponents=2/10/18/26/34,speed_rpm=4000", scene),
        "polydyne": read_cam("polydyne", scene),
    }


@pytest.fixture(scope="session")
def report(tmp_path_factory, lifts):
    """The page of a run folder of kodama whose title would inject a script if it were not escaped."""
    folder = tmp_path_factory.mktemp("browser") / "run"
    data = parts()
    data["comparison"] = rows_of(data["comparison"], lifts)
    write_run(folder, data, "kodama")
    write_cams(folder, lifts, **{k: data["design"][k] for k in ("area_ratio_bound", "area_gap_percent")})
    text = (folder / "scene.toml").read_text(encoding="utf-8")
    geometry = '[geometry]\nfollower = "roller"\nbase_radius_mm = 18\nroller_radius_mm = 8\n\n[[mass]]'
    text = re.sub(r"\[geometry\].*?\[\[mass\]\]", geometry, text, count=1, flags=re.DOTALL)
    text = re.sub('title = ".*"', f'title = "{EVIL_TITLE}"', text)
    (folder / "scene.toml").write_text(text, encoding="utf-8")
    return write_report(folder)


@pytest.fixture
def open_page(browser, report):
    """Opens the report in a new window, under the conditions of `watched_pages`."""
    with watched_pages(browser, report.as_uri()) as opened:
        yield opened
