import subprocess
import sys
from itertools import combinations

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from camopt.plots.style import (
    RC,
    cam_line,
    cam_lines,
    draw_limit,
    family_of,
    legend_above,
    lines,
    new_figure,
    save,
)

# Machado, Oliveira, Fernandes 2009, Table 1: linear RGB as seen by a protanope and a deuteranope
PROTAN = [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
DEUTAN = [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]


def lab(colour: str, seen) -> np.ndarray:
    """CIE L*a*b* (white D65) of an sRGB colour as seen by an eye with the linear-RGB matrix `seen`."""
    s = np.array(to_rgb(colour))
    linear = np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.array(to_xyz) @ np.clip(np.array(seen) @ linear, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("seen", [np.eye(3), PROTAN, DEUTAN], ids=["normal", "protanope", "deuteranope"])
def test_colours_of_cams_stay_apart_for_every_eye(seen):
    colours = {cam: lab(colour, seen) for cam, (colour, _) in lines().items()}
    apart = {pair: np.linalg.norm(colours[pair[0]] - colours[pair[1]]) for pair in combinations(colours, 2)}
    nearest = min(apart, key=lambda pair: apart[pair])
    assert apart[nearest] > 10, nearest  # four times the just noticeable difference (about 2.3)


def test_dashes_tell_cams_apart_without_colour():
    assert len({str(dashes) for _, dashes in lines().values()}) == len(lines())


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("design", "design"),
        ("free", "design"),
        ("polydyne:exponents=2/10/18/26/34,speed_rpm=6000", "polydyne"),
        ("multi-pol (no-jerk)", "multi-pol"),
        ("measured.csv", ""),
        ("", ""),
    ],
)
def test_family_of_a_name(name, family):
    assert family_of(name) == family


def test_a_cam_keeps_its_line_and_the_design_its_own():
    assert cam_line("polydyne") == cam_line("polydyne:speed_rpm=5000")
    assert cam_line("design")["color"] == "#0072B2" != cam_line("polydyne")["color"]
    assert cam_line("intake.csv")["color"] == "#9A6A00"  # the same in every process: no salted hash
    assert cam_line("intake.csv")["color"] not in {colour for colour, _ in lines().values()}


def test_lift_tables_differ_in_a_figure():
    """Of two lift tables with the same colour, the first keeps it in a common figure; the second gets another."""
    tables = [f"{letter}.csv" for letter in "abcdefgh"]
    alike = next((a, b) for a in tables for b in tables if a < b and cam_line(a)["color"] == cam_line(b)["color"])
    by_cam = cam_lines([*alike, "polydyne", "design"])
    assert by_cam[alike[0]]["color"] == cam_line(alike[0])["color"] != by_cam[alike[1]]["color"]
    assert len({(line["color"], str(line["linestyle"])) for line in by_cam.values()}) == 4
    assert len({str(by_cam[name]["linestyle"]) for name in alike}) == 2
    assert by_cam["polydyne"] == cam_line("polydyne") and by_cam["design"] == cam_line("design")


@pytest.mark.parametrize("length", [5, 40, 400])
@pytest.mark.parametrize("count", [1, 3, 7])
def test_a_legend_is_no_wider_than_its_figure(length, count):
    figure = new_figure(6.4, 4.0)
    axes = figure.subplots()
    for i in range(count):
        axes.plot([0, 1], [i, i], label=f"{'runs/a' * length}{i}"[-length:])
    legend_above(figure, axes)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box, edge = legend.get_window_extent(), figure.bbox
    assert edge.x0 <= box.x0 and box.x1 <= edge.x1
    assert all(
        text.get_text().endswith(str(i)) for i, text in enumerate(legend.get_texts())
    )  # the ends distinguish them


def drawn():
    figure = new_figure(3, 2)
    figure.subplots().plot([0, 1, 2], [0, 1, 0], marker="o")
    return figure


def test_saved_files_are_the_same_bytes_each_time(tmp_path):
    first = [p.read_bytes() for p in save(drawn(), tmp_path / "a", "x")]
    second = [p.read_bytes() for p in save(drawn(), tmp_path / "b", "x")]
    assert first == second
    assert first[0].startswith(b"\x89PNG") and b"<svg" in first[1]
    assert b"dc:date" not in first[1]
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["x.png", "x.svg"]


def test_settings_hold_only_inside(tmp_path):
    before = dict(matplotlib.rcParams)
    save(drawn(), tmp_path, "x")
    assert dict(matplotlib.rcParams) == before
    assert before["svg.hashsalt"] != RC["svg.hashsalt"]


def test_a_limit_is_a_line_at_its_value_with_its_words():
    axes = new_figure(3, 2).subplots()
    draw_limit(axes, None, "no limit")
    assert not axes.lines and not axes.texts
    draw_limit(axes, 0.05, "at most")
    assert list(axes.lines[0].get_ydata()) == [0.05, 0.05]
    assert axes.texts[0].get_text() == "at most" and axes.texts[0].xy == (1.0, 0.05)


def test_figures_need_no_pyplot():
    code = (
        "import sys, camopt.plots; camopt.plots.modes([1.0], [[1.0]], ['m']); print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
