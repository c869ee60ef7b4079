"""How soon does the page of `camopt design` answer while a slider is dragged, and after the last change?

`camopt design` runs in its own process and Chromium by Playwright, on five scenes: three built-in ones, and a bucket
tappet and a pushrod train from ../shared/data/scenes beside the repository, which are left out where that folder is
missing. Sliders are moved by keys, a step every 50 ms: limits of the cam, for which constraint rows are kept, and
duration, ramp, spring and lash, for which rows are computed again. The latency is the time from the input to the frame
after the one that shows its first answer, by the page's own clock; inputs that were overtaken by a newer one have none.
"Rest" is the time from the last input to the painted curve of the band. The targets are for two idle cores. To make
runs on busy machines comparable, a fixed loop of arithmetic is timed before every slider: on an idle core its time by
the clock and its processor time are equal, and `p95_per_loop` are latencies in units of it. Memory is that of the
server, over `changes` further answers on the first scene. The small size is `motori-1` with few steps.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from camopt.storage import write_bytes
from experiments.job_time import arithmetic_loop
from experiments.support.record import RESULTS, resident_MB, run_script, write_result

SCENES = Path(__file__).resolve().parents[2] / "shared" / "data" / "scenes"
OTHERS = "bucket-tappet", "pushrod-exhaust"
"""Scenes of that folder."""
SIZES = {
    "small": (("motori-1",), 1, 6, 20),
    "full": (("kodama", "motori-1", "finger-hydraulic", *OTHERS), 2, 20, 300),
}
"""Scenes, number of drags of each slider, steps of a drag, and number of changes over which memory is measured."""
SLIDERS = {
    "limits": ("jerk_max_mm_per_deg3", "acceleration_max_mm_per_deg2", "max_lift_mm"),
    "shape": ("duration_deg", "ramp_height_mm", "spring_rate_percent", "lash_mm"),
}
STEP_MS = 50
WIDTHS = {1366: 520, 420: 700}
"""Widths of the window for pictures of the marks of unfinished answers, and the heights of the pictures [px]."""
TARGETS_MS = {"drag_p95": 300.0, "rest_p95": 1000.0}
ROOT = "document.getElementById('camopt-live')"
LISTEN = f"window.found = []; {ROOT}.addEventListener('camopt-painted', (e) => window.found.push(e.detail))"


def dragged(page, key: str, steps: int) -> list[dict]:
    """Every painted answer while a slider is moved by keys, and after that until the page has settled."""
    slider = page.locator(f"[data-key={key}] input[type=range]")
    if slider.count() == 0 or slider.is_disabled():
        return []
    page.evaluate("window.found.length = 0")
    slider.focus()
    for i in range(steps):
        page.keyboard.press("ArrowRight" if i % 10 < 5 else "ArrowLeft")
        page.wait_for_timeout(STEP_MS)
    for _ in range(600):
        now = page.evaluate(f"({{...{ROOT}.dataset}})")
        if now["mark"] == "settled" or now["state"] != "ok":
            break
        page.wait_for_timeout(100)
    return page.evaluate("window.found")


def timed_loop() -> tuple[float, float]:
    """Clock and processor time of the fixed loop [s]."""
    begun = time.perf_counter()
    processor = arithmetic_loop()
    return time.perf_counter() - begun, processor


def percentiles(values: list[float]) -> dict:
    """The number of latencies, and their percentiles [ms]."""
    p50, p95, most = np.percentile(values, (50, 95, 100)).round(1).tolist() if values else (None, None, None)
    return {"answers": len(values), "p50_ms": p50, "p95_ms": p95, "largest_ms": most}


def watched(page, process: subprocess.Popen, changes: int) -> dict:
    """The server's memory after a tenth, a half and all of a number of changes of the inputs."""
    ask = """async (values) => (await (await fetch('/ask', {
        method: 'POST', headers: {'Content-Type': 'application/json'},
        body: JSON.stringify({kind: 'answer', part: 'sketch', client: 'm', sequence: 1, values})})).json()).state"""
    rows, states = [], {}
    for i in range(changes):
        values = {"max_lift_mm": 9.0 + 0.001 * (i % 97), "duration_deg": 140.0 + 0.05 * (i % 41)}
        values |= {"spring_rate_percent": 100.0 + 0.1 * (i % 53)} if i % 3 == 0 else {}
        state = page.evaluate(ask, values)
        states[state] = states.get(state, 0) + 1
        if i + 1 in (changes // 10, changes // 2, changes):
            rows.append({"changes": i + 1, "resident_MB": round(resident_MB(process.pid), 1)})
    return {"states": states, "memory": rows}


def measured(page, times: int, steps: int) -> dict:
    """Latencies by kind of slider, and at rest."""
    answers: dict[str, list[dict]] = {kind: [] for kind in SLIDERS}
    loops = []
    for kind, keys in SLIDERS.items():
        for key in keys * times:
            loops.append(timed_loop())
            answers[kind] += dragged(page, key, steps)
    sketches = {kind: [a["latency_ms"] for a in every if a["part"] == "sketch"] for kind, every in answers.items()}
    content = {
        "loop_clock_s": float(np.mean([clock for clock, _ in loops])),
        "loop_processor_s": float(np.min([processor for _, processor in loops])),
        "drag": {kind: percentiles(values) for kind, values in sketches.items()},
        "drag_all": percentiles([value for values in sketches.values() for value in values]),
        "rest": percentiles([a["latency_ms"] for every in answers.values() for a in every if a["part"] == "band"]),
    }
    p95 = {"drag_p95": content["drag_all"]["p95_ms"], "rest_p95": content["rest"]["p95_ms"]}
    per_loop = {key: ms and ms / 1000 / content["loop_clock_s"] for key, ms in p95.items()}
    alone = {key: ratio and 1000 * ratio * content["loop_processor_s"] for key, ratio in per_loop.items()}
    reached = {key: ms is not None and ms <= TARGETS_MS[key] for key, ms in p95.items()}
    return {**content, "p95_per_loop": per_loop, "p95_ms_were_the_loop_alone": alone, "reached": reached}


def marks(browser, address: str) -> dict[str, bytes]:
    """Pictures (PNG) of the page at WIDTHS: with the previous numbers, while the first answer to a longer duration is
    blocked, and with a first answer, while the final cam is blocked; each for longer than the second after which the
    page says so."""
    pictures = {}
    for (width, height), (part, mark) in product(WIDTHS.items(), {"sketch": "before", "cam": "first"}.items()):
        page = browser.new_page(viewport={"width": width, "height": height})
        page.goto(address)
        page.wait_for_selector("#camopt-live[data-mark=settled]", timeout=120_000)
        page.route("**/ask", partial(_unless, part))
        duration = page.locator("[data-key=duration_deg] input[type=number]")
        duration.fill(f"{float(duration.input_value()) + width / 1000:g}")
        page.wait_for_selector(f"#camopt-live[data-mark={mark}]", timeout=120_000)
        page.wait_for_timeout(2500)
        pictures[f"{mark}-{width}"] = page.screenshot()
        page.close()
    return pictures


def _unless(part: str, route) -> None:
    """Forwards a request to the server unless it is for this part of an answer."""
    if route.request.post_data_json.get("part") != part:
        route.continue_()


def of_scene(driver, scene: str, times: int, steps: int, changes: int, pictures: Path | None) -> dict:
    """The measurements of one scene's page, with memory if there are `changes`; pictures go into a folder."""
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))))
    with tempfile.TemporaryDirectory() as held:
        words = [sys.executable, "-m", "camopt", "design", scene]
        process = subprocess.Popen(words, cwd=held, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            address = process.stdout.readline().split("open ")[1].split()[0]
            browser = driver.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            page.goto(address)
            page.wait_for_selector("#camopt-live[data-mark=settled]", timeout=120_000)
            time.sleep(1.0 if steps < 10 else 8.0)  # until the first slow parts are finished
            page.evaluate(LISTEN)
            row = {"scene": Path(scene).stem, **measured(page, times, steps)}
            if changes:
                row |= {"over_changes": watched(page, process, changes)}
            if pictures:
                for name, picture in marks(browser, address).items():
                    write_bytes(pictures / f"live_latency-{name}.png", picture)
            browser.close()
        finally:
            process.terminate()
            process.communicate()
    print(row)
    return row


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Drags every slider of every scene, prints and writes live_latency.json into `folder`."""
    from playwright.sync_api import sync_playwright

    names, times, steps, changes = SIZES[size]
    if not SCENES.is_dir():
        names = [name for name in names if name not in OTHERS]
        if size == "full":
            print(f"{', '.join(OTHERS)}: skipped, for {SCENES} is missing")
    paths = [str(SCENES / f"{name}.toml") if name in OTHERS else name for name in names]
    with sync_playwright() as driver:
        rows = [
            of_scene(driver, path, times, steps, *((0, None) if i else (changes, folder if size == "full" else None)))
            for i, path in enumerate(paths)
        ]
    return write_result("live_latency", size, {"targets_ms": TARGETS_MS, "scenes": rows}, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
