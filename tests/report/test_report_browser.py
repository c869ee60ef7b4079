"""The page in a real browser: it opens without errors or requests, and its controls show the run's motion."""

import re

import numpy as np
import pytest

from camopt.exact.engine import prepare
from camopt.measure.settling import settle
from camopt.plots.style import cam_line
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import DEG, MM
from tests.browser import wait
from tests.report.conftest import EVIL_TITLE

SCENE = load_scene("kodama")


def picture(page) -> str:
    return page.evaluate("document.getElementById('train-drawing').innerHTML")


def numbers(page) -> dict[str, list[str]]:
    """Rows of the table of contacts by name: state, force, separation."""
    rows = page.locator("#train-numbers tr").all_inner_texts()[1:]
    return {row.split("\t")[0]: row.split("\t")[1:] for row in rows}


def set_angle(page, degrees: float) -> None:
    page.evaluate(
        "v => { const s = document.getElementById('train-angle'); s.value = v; s.dispatchEvent(new Event('input')); }",
        round((degrees + 180) / 0.5),
    )


def slider(page) -> int:
    return int(page.locator("#train-angle").input_value())


def test_texts_of_the_run_stay_text(open_page):
    page = open_page()
    assert page.locator("h1").inner_text() == EVIL_TITLE
    assert page.title() == f"confirmed: {EVIL_TITLE}"
    assert page.locator("script").count() == 2


def test_numbers_are_the_simulated_motion(open_page, lifts):
    page, train = open_page(), build_train(SCENE)
    for cam, label in (("design", "0"), ("polydyne", "1")):
        page.select_option("#train-cam", label)
        page.select_option("#train-speed", "5000")
        start = state_at_rest(train)
        record = settle(prepare(train, lifts[cam], SCENE.cam_speed(5000)), start).response
        for degrees in (-90.0, -40.0, 0.0, 60.0):
            set_angle(page, degrees)
            at = 2 * np.pi * (record.revolutions - 1) + degrees * DEG
            shown = numbers(page)
            assert list(shown) == ["cam_follower", "follower_valve", "seat"]
            for name, (state, force, apart) in shown.items():
                e = train.element_names.index(name)
                true_force = np.interp(at, record.angle, record.force[:, e])
                assert float(force) == pytest.approx(true_force, rel=0.02, abs=1.0)
                assert float(apart) == pytest.approx(np.interp(at, record.angle, record.separation(e)) / MM, abs=2e-3)
                if abs(true_force) > 1.0:
                    assert state == "closed"
            assert f"cam angle {degrees:.1f} deg".replace("-", "−") in page.locator("#train-caption").inner_text()


def test_every_choice_changes_the_drawing(open_page):
    page = open_page()
    set_angle(page, -30.0)  # the cam is turned and the valve open
    seen = [picture(page)]
    for control, value in (("#train-cam", "1"), ("#train-speed", "5000"), ("#train-gaps", "1")):
        page.select_option(control, value)
        seen.append(picture(page))
    set_angle(page, -30.5)
    seen.append(picture(page))
    assert len(set(seen)) == len(seen)
    stroke = page.locator("#train-chart .curve").get_attribute("stroke")
    assert stroke == cam_line("polydyne")["color"]
    assert page.locator("#train-drawing .contour").get_attribute("stroke") == stroke


def test_the_cam_turns_and_the_valve_follows(open_page):
    page = open_page()
    page.select_option("#train-speed", "5000")
    turned = page.locator("#train-drawing .contour").locator("..")

    def mass_y() -> float:
        group = page.locator("#train-drawing .valve").locator("..")
        return float(re.findall(r"translate\(0 (.*)\)", group.get_attribute("transform") or "")[0])

    set_angle(page, 0.0)
    assert "rotate(0)" in (turned.get_attribute("transform") or "")
    opened = mass_y()
    set_angle(page, -150.0)
    assert "rotate(-150)" in (turned.get_attribute("transform") or "")
    assert opened - mass_y() > 4 * 8.0  # pixels: nearly the whole lift of 9.4 mm, downwards


def test_open_contacts_are_highlighted_and_gaps_magnified(open_page):
    page = open_page()
    page.select_option("#train-speed", "5000")
    set_angle(page, -150.0)  # lash at the valve tip, seat closed
    lights = page.locator("#train-drawing .light")
    by_name = dict(zip(("cam_follower", "follower_valve", "seat"), lights.all(), strict=True))
    state = {name: row[0] for name, row in numbers(page).items()}
    for name, light in by_name.items():
        assert ("on" in (light.get_attribute("class") or "")) == (state[name] == "open")
    assert state["seat"] == "closed" and state["follower_valve"] == "open"
    tall = []
    for factor in ("1", "10", "50"):
        page.select_option("#train-gaps", factor)
        tall.append(float(by_name["follower_valve"].get_attribute("height") or 0))
    assert tall[0] < tall[2] and tall == sorted(tall)


def test_keys_move_play_and_pause(open_page):
    page = open_page()
    caption = page.locator("#train-caption")
    page.focus("#train-angle")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
    page.keyboard.press("ArrowRight")
    assert "−39.5 deg" in caption.inner_text()
    page.keyboard.press("Space")
    wait(page, lambda: slider(page) > 290)
    assert page.locator("#train-play").inner_text() == "Pause"
    page.keyboard.press("Space")
    stopped = caption.inner_text()
    page.wait_for_timeout(150)
    assert caption.inner_text() == stopped and page.locator("#train-play").inner_text() == "Play"


def test_reduced_motion_is_respected(open_page):
    page = open_page(reduced_motion="reduce")
    page.click("#train-play")
    for _ in range(3):
        before = slider(page)
        wait(page, lambda before=before: slider(page) != before)
        assert (slider(page) - 280) % 10 == 0  # whole steps of 5 deg, perhaps two on a slow machine


def test_a_phone_shows_all_without_sideways_scrolling(open_page):
    page = open_page(viewport={"width": 375, "height": 812})
    assert page.evaluate("document.documentElement.scrollWidth") == 375
    for control in ("#train-cam", "#train-speed", "#train-play", "#train-angle", "#train-drawing"):
        box = page.locator(control).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 375


def test_print_shows_the_figures_and_no_controls(open_page):
    page = open_page()
    page.emulate_media(media="print")
    assert not page.locator("#train-play").is_visible() and not page.locator("nav").is_visible()
    for part in ("#train-drawing", "#train-chart", "#train-caption", "figure img >> nth=0"):
        assert page.locator(part).is_visible()
    page.set_viewport_size({"width": 718, "height": 1000})  # the text of an A4 page with margins of 10 mm
    wide = page.locator(".scroll table").evaluate_all("tables => tables.map((t) => t.getBoundingClientRect().right)")
    assert max(wide) <= 718


def test_a_foreign_script_does_not_run(browser, report):
    page = browser.new_page()
    page.goto(report.as_uri())
    page.evaluate(
        "() => { const s = document.createElement('script'); s.textContent = 'window.ran = 1';"
        "document.body.append(s); }"
    )
    assert page.evaluate("window.ran === undefined")
    page.close()
