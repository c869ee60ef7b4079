"""The designer's page in a real browser: its numbers, its keys, its errors, and its accessibility."""

import json
import subprocess
import sys

import pytest

from camopt.designer.session import Session
from camopt.scene import load_scene
from tests.browser import serious_faults, wait, watched_pages

SCENE = load_scene("motori-1")
ROOT = "document.getElementById('camopt-live')"


@pytest.fixture(scope="module")
def served(serve, tmp_path_factory):
    return serve(SCENE, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def session():
    """A session of the Python API with the page's scene."""
    return Session(SCENE)


@pytest.fixture
def open_page(browser, served):
    """Opens the page and waits until it rests, under the conditions of `watched_pages`."""
    with watched_pages(browser, served.address) as opened:

        def opened_at_rest(**settings):
            page = opened(**settings)
            rest(page)
            return page

        yield opened_at_rest


def data(page) -> dict:
    return page.evaluate(f"({{...{ROOT}.dataset}})")


def rest(page) -> None:
    """Wait for the band of the newest values, or for the answer that they have no cam."""

    def done() -> bool:
        now = data(page)
        newest = now.get("sequence")
        return newest is not None and (now.get("band") == newest or (now.get("cam") == newest and now["state"] != "ok"))

    wait(page, done)


def area_shown(page) -> float:
    return float(page.locator(".result").inner_text().split("Area ratio ")[1].split()[0])


def slider(page, key):
    return page.locator(f"[data-key={key}] input[type=range]")


def number(page, key):
    return page.locator(f"[data-key={key}] input[type=number]")


def type_number(page, key: str, text: str) -> None:
    """Enter a number and wait until the page rests."""
    number(page, key).fill(text)
    rest(page)


def test_typed_and_dragged_values_give_the_numbers_of_the_api(open_page, session):
    page = open_page()
    assert area_shown(page) == pytest.approx(session.answer({})["area_ratio"], abs=5e-6)
    type_number(page, "max_lift_mm", "9.0")
    values = {"max_lift_mm": 9.0}
    assert area_shown(page) == pytest.approx(session.answer(values)["area_ratio"], abs=5e-6)
    slider(page, "duration_deg").focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    rest(page)
    values["duration_deg"] = float(number(page, "duration_deg").input_value())
    assert values["duration_deg"] > SCENE.design.duration_deg
    answer, band = session.answer(values), session.answer(values, "band")
    assert area_shown(page) == pytest.approx(answer["area_ratio"], abs=5e-6)
    assert f"bounce {answer['motion']['metrics']['bounce_mm']:.3g}"[:9] in page.locator(".result").inner_text()
    worst = band["worst"]["bounce_max_mm"]
    words = page.locator("[data-key=bounce_max_mm] .worth").inner_text()
    assert f"{round(100 * worst['used'])} % at {worst['speed_rpm']:g} r/min" in words
    assert page.locator("[data-key=max_lift_mm] .worth").inner_text().startswith("▲ active")


def test_fifty_rapid_inputs_end_in_the_right_state(open_page, session):
    page = open_page()
    page.evaluate(
        "() => { const s = document.querySelector('[data-key=max_lift_mm] input[type=range]');"
        "for (let i = 0; i < 50; i++) { s.value = 8 + 0.02 * i; s.dispatchEvent(new Event('input')); }"
        "s.dispatchEvent(new Event('change')); }"
    )
    rest(page)
    lift = float(number(page, "max_lift_mm").input_value())
    assert lift == pytest.approx(8.98, abs=0.03)
    assert area_shown(page) == pytest.approx(session.answer({"max_lift_mm": lift})["area_ratio"], abs=5e-6)
    assert data(page)["cam"] == data(page)["sequence"]


def words(page) -> str:
    return page.locator(".mark").inner_text()


def held_back(page, part: str) -> dict:
    """Delays the requests for one part of the answer until `let_go`."""
    held = {"open": False, "routes": []}

    def hold(route):
        if not held["open"] and route.request.post_data_json.get("part") == part:
            held["routes"].append(route)
        else:
            route.fallback()

    page.route("**/ask", hold)
    return held


def let_go(held: dict) -> None:
    held["open"] = True
    while held["routes"]:
        held["routes"].pop(0).continue_()


def test_the_mark_states_to_which_numbers_the_answer_belongs(open_page):
    """With delayed answers, the marks follow each other: earlier numbers and their difference, first answer, cam,
    settled."""
    page = open_page()
    assert data(page)["mark"] == "settled" and words(page) == "Settled: cam, motion and band of these numbers."
    held = {part: held_back(page, part) for part in ("sketch", "cam", "band")}
    duration = SCENE.design.duration_deg
    number(page, "duration_deg").fill(f"{duration + 1:g}")
    assert words(page).startswith(
        f"Result for the previous numbers (Duration {duration:g}, not {duration + 1:g}); the new ones are"
    )
    caption = page.locator("figure.chart figcaption >> nth=0")
    after = "getComputedStyle(document.querySelector('figure.chart figcaption'), '::after').content"
    assert page.evaluate(after) == '" (of the numbers before)"' and caption.is_visible()
    wait(page, lambda: held["sketch"]["routes"])
    let_go(held["sketch"])
    wait(page, lambda: data(page)["mark"] == "first")
    assert words(page).startswith("First result for these numbers") and page.evaluate(after) == '" (first answer)"'
    wait(page, lambda: held["cam"]["routes"])
    let_go(held["cam"])
    wait(page, lambda: data(page)["mark"] == "cam")
    assert "bounce and jump over the band are being computed" in words(page) and page.evaluate(after) == "none"
    assert "before" in page.locator("figure.chart").filter(has_text="Bounce over").get_attribute("class")
    wait(page, lambda: held["band"]["routes"])
    let_go(held["band"])
    wait(page, lambda: data(page)["mark"] == "settled")
    assert page.locator(".chart.before").count() == 0


def test_a_long_wait_shows_its_progress_and_can_be_cancelled(open_page):
    page = open_page()
    before, shown = number(page, "max_lift_mm").input_value(), page.locator(".result").inner_text()
    held, cancel = held_back(page, "sketch"), page.get_by_role("button", name="Cancel the answer")
    number(page, "max_lift_mm").fill("9.2")
    assert not cancel.is_visible()
    wait(page, cancel.is_visible)
    assert page.locator(".marked progress >> nth=0").is_visible() and " s)." in words(page)
    newest = data(page)["sequence"]
    with page.expect_request(lambda r: r.post_data_json.get("kind") == "newest") as request:
        cancel.press("Enter")
    assert request.value.post_data_json["sequence"] == int(newest) + 1
    assert number(page, "max_lift_mm").input_value() == before and not cancel.is_visible()
    assert data(page)["mark"] == "settled" and page.evaluate("document.activeElement.textContent") != ""
    let_go(held)
    page.wait_for_timeout(500)  # the cancelled answer comes, and is not shown
    assert page.locator(".result").inner_text() == shown and data(page)["mark"] == "settled"
    type_number(page, "max_lift_mm", "9.1")
    assert data(page)["mark"] == "settled" and page.locator(".result").inner_text() != shown


def test_the_last_change_wins_over_one_that_takes_long(open_page):
    """A change cancels the cam at rest at once, and a first answer after half a second."""
    page = open_page()
    messages = []
    page.on("request", lambda r: messages.append(r.post_data_json) if r.method == "POST" else None)
    for part in ("cam", "sketch"):
        held = held_back(page, part)
        number(page, "duration_deg").fill("146")
        wait(page, lambda held=held: held["routes"])
        messages.clear()
        number(page, "duration_deg").fill("145")
        wait(page, lambda: [m for m in messages if m["kind"] == "newest"])
        assert [m["sequence"] for m in messages if m["kind"] == "newest"] == [int(data(page)["sequence"])]
        let_go(held)
        rest(page)
        assert [m["values"]["duration_deg"] for m in messages if m.get("part") == "sketch"][-1] == 145
        page.unroute("**/ask")
        type_number(page, "duration_deg", "144")


def test_undo_redo_reset_and_pin(open_page):
    page = open_page()
    first = page.locator(".result").inner_text()
    assert page.get_by_role("button", name="Undo").is_disabled()
    page.get_by_role("button", name="Pin to compare").click()
    number(page, "max_lift_mm").fill("8.5")
    number(page, "max_lift_mm").press("Tab")
    rest(page)
    second = page.locator(".result").inner_text()
    assert first != second and page.locator(".line.pinned").count() >= 4
    assert "Against the pinned design" in page.locator(".compared").inner_text()
    page.get_by_role("button", name="Undo").press("Enter")
    rest(page)
    assert page.locator(".result").inner_text() == first
    page.keyboard.press("Enter")  # Undo is disabled, and the focus has gone on to Redo
    rest(page)
    assert page.locator(".result").inner_text() == second
    page.get_by_role("button", name="Reset").click()
    rest(page)
    assert page.locator(".result").inner_text() == first
    page.get_by_role("button", name="Unpin").click()
    assert page.locator(".line.pinned").count() == 0


def test_a_fault_is_shown_beside_its_field(open_page):
    page = open_page()
    number(page, "max_lift_mm").fill("-3")
    wait(page, lambda: "greater than 0" in page.locator("[data-key=max_lift_mm] .fault").inner_text())
    assert number(page, "max_lift_mm").get_attribute("aria-invalid") == "true"
    assert "not a valid scene" in page.locator(".result").inner_text()
    number(page, "max_lift_mm").fill("")
    assert "expected a number" in page.locator("[data-key=max_lift_mm] .fault").inner_text()
    type_number(page, "max_lift_mm", "9")
    assert page.locator("[data-key=max_lift_mm] .fault").inner_text() == ""
    assert number(page, "max_lift_mm").get_attribute("aria-invalid") is None


def test_limits_without_a_cam_are_reported(open_page):
    page = open_page()
    page.locator("[data-key=reach_max_lift] input").check()
    number(page, "max_lift_mm").fill("30")
    wait(page, lambda: page.locator(".result").inner_text().startswith("No cam: "))
    assert "stale" in page.locator("#camopt-live").get_attribute("class")
    page.get_by_role("button", name="Reset").click()
    rest(page)
    assert "stale" not in page.locator("#camopt-live").get_attribute("class")


def test_the_status_is_unconfirmed_and_a_verdict_can_be_cancelled(open_page):
    page = open_page()
    status = page.locator(".status")
    assert status.inner_text() == "event-exact only, not confirmed"
    page.get_by_role("button", name="Verify").press("Enter")
    wait(page, lambda: "verdict running" in status.inner_text())
    page.keyboard.press("Enter")  # Verify is hidden, and the focus has gone on to Cancel
    wait(page, lambda: "was cancelled" in status.inner_text())
    assert status.inner_text().startswith("event-exact only, not confirmed")


@pytest.mark.long
def test_a_verdict_is_completed_and_saved_in_the_run_folder(open_page, served):
    page = open_page()
    status = page.locator(".status")
    page.get_by_role("button", name="Verify").click()
    wait(page, lambda: "So far: " in status.inner_text() or data(page)["verdict"] not in ("running", "none"))
    wait(page, lambda: data(page)["verdict"] != "running")
    verdict = data(page)["verdict"]
    sign = "✓ confirmed by independent methods" if verdict == "confirmed" else f"✗ {verdict}."
    assert status.inner_text().startswith(sign)
    page.locator("#camopt-name").fill("verdict-run")
    page.get_by_role("button", name="Save run folder").click()
    wait(page, lambda: "Saved as verdict-run" in page.locator(".saved").inner_text())
    stored = json.loads((served.requests.folder / "verdict-run" / "verification.json").read_text())
    assert stored["verdict"] == verdict
    number(page, "max_lift_mm").fill("8.8")
    wait(page, lambda: "the last verdict was of other numbers" in status.inner_text())


def test_a_chart_keeps_its_zoom_while_numbers_change(open_page):
    page = open_page()
    figure = page.locator("figure.chart").filter(has_text="Cam lift")
    figure.locator("> svg").focus()
    page.keyboard.press("+")
    closer = figure.locator("text").all_text_contents()
    type_number(page, "max_lift_mm", "9.1")
    assert figure.locator("button").is_visible()
    assert [t for t in figure.locator("text").all_text_contents() if "−90" in t] == [] and closer
    page.keyboard.press("Tab")
    figure.locator("button").click()
    assert not figure.locator("button").is_visible()


def test_a_scene_is_saved_from_the_page(open_page, served):
    page = open_page()
    type_number(page, "max_lift_mm", "8.7")
    page.locator("#camopt-name").fill("from-page")
    page.get_by_role("button", name="Save scene").click()
    wait(page, lambda: "Saved as from-page.toml" in page.locator(".saved").inner_text())
    assert load_scene(served.requests.folder / "from-page.toml").design.max_lift_mm == 8.7


def test_every_control_can_be_reached_and_moved_by_keys(open_page):
    page = open_page()
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    reached = set()
    page.evaluate("document.body.focus()")
    for _ in range(200):
        page.keyboard.press("Tab")
        key = page.evaluate("document.activeElement.closest('[data-key]')?.dataset.key ?? document.activeElement.id")
        reached.add(key)
        style = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert style != "none" or key in ("", None)
    wanted = {c.key for c in Session(SCENE).controls.values()}
    assert wanted <= reached
    assert {"train-play", "train-angle", "camopt-name"} <= reached


def test_the_valve_train_moves_with_the_angle(open_page):
    page = open_page()
    caption = page.locator("#train-caption")
    wait(page, caption.inner_text)  # the first answer may come after the band
    page.locator("#train-angle").focus()
    before = caption.inner_text()
    page.keyboard.press("ArrowRight")
    wait(page, lambda: caption.inner_text() != before)
    assert page.locator("#train-drawing .contour").count() == 1


def test_there_is_no_serious_accessibility_fault(open_page):
    page = open_page(bypass_csp=True)  # axe is a script of its own
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    assert serious_faults(page) == []


def test_a_phone_shows_all_without_sideways_scrolling(open_page):
    page = open_page(viewport={"width": 375, "height": 812})
    assert page.evaluate("document.documentElement.scrollWidth") == 375
    for part in (".result", ".chart >> nth=0", "#train-drawing", ".areas table"):
        box = page.locator(part).bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= 376, part


def started(folder, port: int) -> tuple[subprocess.Popen, str]:
    """The command in a process, and the address that it prints."""
    words = [sys.executable, "-m", "camopt", "design", "motori-1", "--port", str(port)]
    process = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, text=True)
    line = process.stdout.readline()
    return process, line.split("open ")[1].split()[0]


def killed(process: subprocess.Popen) -> None:
    process.kill()
    process.communicate()


def test_the_page_reports_a_killed_server_and_continues_with_a_new_one(browser, tmp_path, session):
    process, address = started(tmp_path, 0)
    page = browser.new_page()
    try:
        page.goto(address)
        rest(page)
        killed(process)
        number(page, "max_lift_mm").fill("8.9")
        wait(page, lambda: page.locator(".trouble").is_visible())
        assert "does not answer any more" in page.locator(".trouble").inner_text()
        process, again = started(tmp_path, int(address.rstrip("/").rpartition(":")[2]))
        assert again == address
        wait(page, lambda: not page.locator(".trouble").is_visible())
        rest(page)
        assert area_shown(page) == pytest.approx(session.answer({"max_lift_mm": 8.9})["area_ratio"], abs=5e-6)
    finally:
        page.close()
        killed(process)


def test_texts_of_the_scene_stay_text(browser, serve, tmp_path):
    evil = "<img src=x onerror=\"document.title='changed'\">"
    server = serve(SCENE.model_copy(update={"title": evil}), tmp_path)
    page = browser.new_page()
    page.goto(server.address)
    rest(page)
    assert page.locator("h1").inner_text() == evil and page.title() == "camopt design"
    assert json.loads(page.evaluate("JSON.stringify(document.querySelectorAll('img').length)")) == 0
    page.close()
