"""The report's charts and its first screen in a real browser: values under the pointer, zoom, cams on and off, nothing
cut off, nothing loaded, and no serious accessibility fault."""

import numpy as np
import pytest

from camopt.exact.engine import prepare
from camopt.measure.settling import settled_from_rest
from camopt.scene import build_train, load_scene
from camopt.scene.units import DEG, MM
from tests.browser import serious_faults

SCENE = load_scene("kodama")


def chart(page, place: str, title: str):
    return page.locator(f"#{place} figure.chart").filter(has_text=title)


def middle(page, figure) -> tuple[float, float]:
    """The middle of a chart in pixels, after scrolling it into view."""
    figure.scroll_into_view_if_needed()
    box = figure.locator("> svg").bounding_box()
    return box["x"] + 52 + (box["width"] - 70) / 2, box["y"] + box["height"] / 2


def test_the_pointer_reads_the_value_of_every_cam(open_page, lifts):
    page = open_page()
    figure = chart(page, "charts-cams", "Cam lift")
    x, y = middle(page, figure)
    page.mouse.move(x, y)
    words = figure.locator(".values").inner_text()
    angle = float(words.split(":")[0].split()[-1].replace("−", "-"))
    assert abs(angle) <= 1.0  # the middle of the axis
    for name, lift in lifts.items():
        shown = float(words.split(f"{name} ")[1].split(",")[0])
        assert shown == pytest.approx(float(lift(angle * DEG)) / MM, abs=2e-3)
    page.mouse.move(2, 2)
    assert figure.locator(".values").inner_text() == ""


def test_keys_read_values_and_zoom(open_page):
    page = open_page()
    figure = chart(page, "charts-motion", "Valve lift")
    figure.locator("> svg").focus()
    page.keyboard.press("ArrowRight")
    assert "design" in figure.locator(".values").inner_text()
    before = figure.locator("text").all_text_contents()
    page.keyboard.press("+")
    assert figure.locator("text").all_text_contents() != before
    page.get_by_role("button", name="whole axis").click()
    assert figure.locator("text").all_text_contents() == before


def test_dragging_zooms_to_a_part_of_the_axis(open_page):
    page = open_page()
    figure = chart(page, "charts-cams", "Acceleration")
    x, y = middle(page, figure)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y)
    page.mouse.up()
    assert page.get_by_role("button", name="whole axis").is_visible()
    page.mouse.dblclick(x, y)
    assert not page.get_by_role("button", name="whole axis").is_visible()


def test_cams_are_switched_on_and_off(open_page):
    page = open_page()
    figure = chart(page, "charts-cams", "Jerk")
    assert figure.locator(".line").count() == 2
    page.get_by_role("checkbox", name="polydyne").uncheck()
    assert figure.locator(".line").count() == 1
    page.get_by_role("checkbox", name="design").uncheck()
    assert not figure.is_visible()
    page.get_by_role("checkbox", name="polydyne").check()
    assert figure.locator(".line").count() == 1


def slowest(page, title: str) -> dict[str, float]:
    """Values of a chart over the speeds at the lowest speed, by line."""
    figure = chart(page, "charts-band", title)
    figure.scroll_into_view_if_needed()
    box = figure.locator("> svg").bounding_box()
    page.mouse.move(box["x"] + 53, box["y"] + box["height"] / 2)
    where, words = figure.locator(".values").inner_text().replace("−", "-").split(": ")
    assert where == f"crankshaft speed {min(SCENE.operation.speeds_rpm):g}"
    return {name: float(value) for name, value in (row.rsplit(" ", 1) for row in words.split(", "))}


def test_phases_by_speed_are_those_of_the_motion(open_page, lifts):
    page, train = open_page(), build_train(SCENE)
    opens, touches = slowest(page, "the valve opens"), slowest(page, "touches its seat")
    for name, lift in lifts.items():
        record = settled_from_rest(prepare, train, lift, SCENE.cam_speed(min(SCENE.operation.speeds_rpm))).response
        last = record.angle >= record.angle[-1] - 2 * np.pi
        angle, apart = record.angle[last] - record.angle[-1] + np.pi, record.seat_separation()[last]
        closed, top = np.flatnonzero(apart <= 0), np.argmax(apart)
        assert opens[name] == pytest.approx(angle[closed[closed < top][-1]] / DEG, abs=0.3)
        assert touches[f"{name} touches"] == pytest.approx(angle[closed[closed > top][0]] / DEG, abs=0.3)
        assert touches[f"{name} rests"] >= touches[f"{name} touches"] - 1e-9


def test_forces_and_phase_plane_are_those_of_the_chosen_speed(open_page):
    page = open_page()
    figures = [chart(page, "charts-motion", title) for title in ("Force of cam_follower", "Phase plane: velocity")]
    before = [figure.locator(".line").first.get_attribute("d") for figure in figures]
    assert before[1].count("L") > 200  # points while the valve is open
    page.locator("#motion-speed select").select_option("5000")
    for figure, line in zip(figures, before, strict=True):
        assert figure.locator(".line").first.get_attribute("d") != line
    assert chart(page, "charts-motion", "close to the seat").is_visible()


def test_the_first_screen_shows_verdict_cam_worth_and_next_steps(open_page):
    page = open_page()
    for part in (".verdict .line >> nth=0", ".sketch", "#worth", "#next", "#matrix", ".matrix tr >> nth=3"):
        box = page.locator(part).bounding_box()
        assert box["y"] + box["height"] <= 768, part
    assert "worst" in page.locator(".matrix").inner_text()
    assert page.locator("#tightest-spot").count() == 1


@pytest.mark.parametrize("width", [1366, 1920])
def test_no_table_is_cut_off(open_page, width):
    page = open_page(viewport={"width": width, "height": 768})
    cut = page.locator(".scroll").evaluate_all(
        "boxes => boxes.filter((b) => b.scrollWidth > b.clientWidth + 1).map((b) => b.innerText.slice(0, 40))"
    )
    assert cut == [] and page.evaluate("document.documentElement.scrollWidth") == width


def test_there_is_no_serious_accessibility_fault(open_page):
    page = open_page(bypass_csp=True)  # axe is a script of its own
    assert serious_faults(page) == []
