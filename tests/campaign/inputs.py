"""Generators of hostile inputs: scenes, cam names, lift tables, design files, sweep plans, earlier runs, command lines.

A case consists of some files in a folder and one command that runs there.
"""

import json
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import tomli_w

from camopt.scene import builtin_scenes, scene_text
from tests.campaign.values import FACTORS, NUMBERS, TEXTS, spoiled, torn
from tests.command_line import contents

DATA = Path(__file__).parents[1] / "data"
DESIGN = DATA / "kodama-design.json"
EARLIER = DATA / "version-0.1.0"
"""Output of a released version: a run folder, a yield, a sweep's store."""
SCENES = tuple(builtin_scenes())
POLYDYNE = "polydyne"


@dataclass(frozen=True)
class Case:
    """One command and the files that it reads."""

    kind: str
    seed: int
    words: list[str]
    files: dict[str, bytes] = field(default_factory=dict)


@cache
def record_of(name: str) -> dict:
    """A built-in scene as a nested dictionary."""
    return tomllib.loads(scene_text(name))


def _verbs(draw: Random, scene: str, cam: str) -> list[str]:
    """A quick command that reads a scene, sometimes with a cam."""
    speed = draw.choice(("300", "3000", "6000", "20000"))
    simulate = ["simulate", scene, "--cam", cam, "--speed", speed, "--revolutions", "1", "--method"]
    return draw.choice(
        (
            ["modes", scene],
            ["modes", scene, "--state", "seated", "--json", "modes.json"],
            ["cam", scene, "--cam", cam],
            ["cam", scene, "--cam", cam, "--csv", "lift.csv", "--contour", "contour.csv"],
            [*simulate, "event"],
            [*simulate, draw.choice(("rkg", "tmm", "houbolt")), "--csv", "motion.csv"],
        )
    )


def scene_case(draw: Random, seed: int) -> Case:
    """A built-in scene with faults in its keys or in its bytes."""
    record = record_of(draw.choice(SCENES))
    try:
        text = tomli_w.dumps(spoiled(record, draw))
    except (TypeError, ValueError, AttributeError):  # a value that TOML cannot represent
        text = tomli_w.dumps(record)
    data = torn(text, draw) if draw.random() < 0.2 else text.encode(errors="replace")
    cam = draw.choice((POLYDYNE, POLYDYNE, "trapezoid", "exponent"))
    return Case("scene", seed, _verbs(draw, "scene.toml", cam), {"scene.toml": data})


def cam_case(draw: Random, seed: int) -> Case:
    """A family with extreme, misspelt or repeated parameters."""
    family = draw.choice(("polydyne", "exponent", "kurz", "trapezoid", "multi-pol", "new-design", "poly", ""))
    names = (
        "exponents",
        "speed_rpm",
        "ramp_height_mm",
        "ramp_velocity_mm_per_deg",
        "duration_deg",
        "max_lift_mm",
        "lift",
    )
    ends = (*map(str, NUMBERS), *TEXTS[:8], "2/10/18/26/34", "2/2/2/2/2", "-2/1e9", "2/4/6/8/1000000", "9" * 400)
    given = ",".join(f"{draw.choice(names)}={_end(draw, ends)}" for _ in range(draw.randrange(3)))
    name = f"{family}:{given}" if given else family
    return Case("cam", seed, _verbs(draw, draw.choice(("kodama", "motori-1", "pushrod-5mass")), name))


def _end(draw: Random, ends: tuple[str, ...]) -> str:
    if draw.random() < 0.3:
        return draw.choice(ends)
    return f"{draw.choice((0.2, 0.011, 9.4, 144, 6000)) * draw.choice(FACTORS):g}"


def table_case(draw: Random, seed: int) -> Case:
    """A measured table with typical faults of measuring and copying."""
    step = draw.choice((0.5, 1.0, 2.0))
    angle = np.arange(-90, 90 + step / 2, step) + draw.choice((0, 0, 200, 1e6))
    lift = 9.0 * np.cos(np.clip((angle - angle.mean()) / 72 * np.pi / 2, -np.pi / 2, np.pi / 2)) ** 2
    lift = lift * draw.choice((1, 1, 1, -1, 1e-3, 1e9)) + draw.choice((0, 0, 0.2, -5))
    random = np.random.default_rng(seed)
    if draw.random() < 0.3:
        angle = angle + step * draw.choice((0.01, 1.0)) * random.standard_normal(angle.size)
    if draw.random() < 0.3:
        lift = lift + draw.choice((1e-4, 0.1, 100.0)) * random.standard_normal(angle.size)
    rows = [[float(a), float(b)] for a, b in zip(angle, lift, strict=True)]
    for _ in range(draw.randrange(4)):
        row = draw.randrange(len(rows))
        change = draw.randrange(5)
        if change == 0:
            rows.insert(row, rows[row])
        elif change == 1:
            del rows[row : row + draw.randint(1, 30)]
        elif change == 2:
            rows[row][1] = draw.choice(NUMBERS)
        elif change == 3:
            rows = rows[::-1] if draw.random() < 0.3 else rows[: max(row, 1)]
        else:
            rows[row].append(draw.choice(NUMBERS))
        rows = rows or [[0.0, 0.0]]
    mark = draw.choice((",", ",", ";", "\t", " "))
    header = draw.choice(("", "angle_deg,lift_mm\n", "# table-angle: cam\n# table-lift: mm\n", "\ufeffcam;lift\n"))
    text = header + "".join(mark.join(f"{v}" for v in row) + "\n" for row in rows)
    if draw.random() < 0.1:
        text = text.replace(".", ",")
    data = torn(text, draw) if draw.random() < 0.15 else text.encode()
    words = _verbs(draw, "kodama", "table.csv")
    if words[0] == "modes":
        words = ["cam", "kodama", "--cam", "table.csv"]
    if draw.random() < 0.8:
        words += ["--table-angle", draw.choice(("cam", "crank")), "--table-lift", draw.choice(("mm", "m", "inch"))]
    return Case("table", seed, words, {"table.csv": data})


def design_case(draw: Random, seed: int) -> Case:
    """A design file with faults in its keys or in its bytes."""
    record = spoiled(json.loads(DESIGN.read_text(encoding="utf-8")), draw)
    text = json.dumps(record)
    data = torn(text, draw) if draw.random() < 0.2 else text.encode(errors="replace")
    words = ["cam", "kodama", "--cam", "design.json"]
    if draw.random() < 0.3:
        words = ["simulate", "kodama", "--cam", "design.json", "--speed", "6000", "--revolutions", "1"]
    return Case("design", seed, words, {"design.json": data})


def limit_case(draw: Random, seed: int) -> Case:
    """A member of a family under limits of any size, most of which are contradictory."""
    record = json.loads(json.dumps(record_of(draw.choice(("kodama", "motori-1", "pushrod-5mass")))))
    design = record["design"]
    keys = [key for key, value in design.items() if isinstance(value, float) and not isinstance(value, bool)]
    for key in draw.sample(sorted(keys), draw.randint(1, 2)):
        design[key] *= 10.0 ** draw.uniform(-12.0, 6.0)
    cam = draw.choice(("trapezoid", "kurz", "multi-pol", "new-design"))
    return Case("limit", seed, ["cam", "scene.toml", "--cam", cam], {"scene.toml": tomli_w.dumps(record).encode()})


def law_case(draw: Random, seed: int) -> Case:
    """A design file with continuous pieces whose lift law may not be a cam: flat, negative, or without ramps."""
    half = 10.0 ** draw.uniform(-5.0, 2.2)
    lift, base = draw.choice((0.0, 9.0, -9.0, 1e-6, 1e6)), draw.choice((0.0, 0.0, 0.0, 3.0, -3.0))
    bump = np.polynomial.Polynomial([lift, 0.0, -2 * lift / half**2, 0.0, lift / half**4])
    at = [(bump(np.polynomial.Polynomial([start, 1.0])) + base).coef.tolist() for start in (-half, 0.0)]
    pieces = ([-180.0, -half, 0.0, half, 180.0], [[base], *at, [base]])
    if draw.random() < 0.3:
        pieces = draw.choice((([-180.0, 180.0], [[base]]), ([-180.0, 0.0, 180.0], [[base, 0.05], [base + 9, -0.05]])))
    (*start, _), (_, *end) = pieces[0], pieces[0]
    content = {"start_deg": start, "end_deg": end, "coefficients_mm": pieces[1]}
    duration = 2 * half if draw.random() < 0.5 else draw.choice((1e-3, 144.0, 359.0))
    words = draw.choice(
        (
            ["cam", "kodama", "--cam", "law.json"],
            ["cam", "kodama", "--cam", "law.json", "--csv", "lift.csv", "--contour", "contour.csv"],
            ["simulate", "kodama", "--cam", "law.json", "--speed", "6000", "--revolutions", "1"],
            ["yield", "kodama", "--cam", "law.json", "--trains", "2", "--speeds", "6000", "--out", "run"],
        )
    )
    return Case("law", seed, words, {"law.json": json.dumps({"duration_deg": duration, "pieces": content}).encode()})


def plan_case(draw: Random, seed: int) -> Case:
    """A sweep's plan with faults, with a store that is new, foreign or damaged."""
    plan = {
        "format": 1,
        "verb": draw.choice(("rehearse", "settled", "simulate", "yield")),
        "scenes": ["motori-1"],
        "cams": ["polydyne"],
        "speeds_rpm": [4000],
        "vary": {"spring": {"preload_N": [240, 250]}},
        "settings": {"tasks": 2, "seconds": 0.0},
    }
    try:
        text = tomli_w.dumps(spoiled(plan, draw))
    except (TypeError, ValueError, AttributeError):
        text = tomli_w.dumps(plan)
    files = {"plan.toml": torn(text, draw) if draw.random() < 0.2 else text.encode(errors="replace")}
    words = ["sweep", "plan.toml", "--store", "rows.sqlite", "--workers", "1"]
    if draw.random() < 0.3:
        files["rows.sqlite"] = draw.choice((b"", b"SQLite format 3\0" + draw.randbytes(200), draw.randbytes(50)))
        words += ["--resume"]
    return Case("plan", seed, words, files)


def command_case(draw: Random, seed: int) -> Case:
    """A command line of random words and options with random values."""
    scene = draw.choice((*SCENES, "none", "..", "", "/dev/null", "scene.toml", *TEXTS[:12]))
    numbers = [str(n) for n in NUMBERS] + ["9" * 5000, "1:2:3", "1:1e308:1e-308", "5000,,", "1e-400", "0x10", "٣"]
    options = (
        *("--speed", "--speeds", "--step-deg", "--revolutions", "--method", "--accuracy", "--cam", "--csv", "--json"),
        *("--figure", "--contour", "--digits", "--state", "--table-angle", "--seed", "--trains", "--tolerance-mm"),
        *("--out", "--resume", "--quiet", "--debugging", "-h", "--yield"),
    )
    words = [draw.choice(("modes", "cam", "simulate", "scenes", "report", "yield", "verify", "sweep", "modez", ""))]
    words += [scene] if draw.random() < 0.9 else []
    given = (*numbers, *TEXTS[:12], "polydyne", "event", "6000", "draft", "x.svg")
    for _ in range(draw.randrange(6)):
        words += [draw.choice(options), draw.choice(given)]
    if words[0] in ("yield", "verify"):  # without a fault these would take long, so one is added
        words += ["--speeds", draw.choice(("-1", "0", "nan", "5000:4000:10", "1:1e15:1e-12"))]
    return Case("command", seed, [w for w in words if "\0" not in w])


def folder_case(draw: Random, seed: int) -> Case:
    """A folder or store of an earlier run with one file damaged, edited or missing."""
    files = contents(EARLIER)
    words = draw.choice(
        (
            ["cam", "motori-1", "--cam", "run", "--csv", "lift.csv"],
            ["report", "run", "--check"],
            ["optimize", "motori-1", "--speeds", "nominal", "--accuracy", "draft", "--out", "run", "--resume"],
            ["yield", "motori-1", "--cam", "polydyne", "--trains", "10", "--out", "yield", "--resume"],
            ["sweep", "plan.toml", "--store", "sweep.sqlite", "--resume", "--workers", "1"],
        )
    )
    part = next((word for word in ("run", "yield", "sweep") if word in words), "")
    name = draw.choice([name for name in files if name.startswith(part)])
    kind = draw.randrange(3)
    if kind == 0:
        del files[name]
    elif kind == 1 and name.endswith(".json"):
        files[name] = json.dumps(spoiled(json.loads(files[name]), draw)).encode(errors="replace")
    else:
        files[name] = torn(files[name], draw)
    return Case("folder", seed, words, files)


KINDS: dict[str, tuple[Callable[[Random, int], Case], int]] = {
    "scene": (scene_case, 40),
    "cam": (cam_case, 15),
    "table": (table_case, 15),
    "design": (design_case, 15),
    "limit": (limit_case, 4),
    "law": (law_case, 4),
    "plan": (plan_case, 1),
    "folder": (folder_case, 1),
    "command": (command_case, 13),
}
"""The function that draws a case of each kind, and its relative frequency."""


def drawn(seed: int) -> Case:
    """The case with a number, the same on every machine."""
    draw = Random(seed)
    (case, _) = draw.choices(list(KINDS.values()), [weight for _, weight in KINDS.values()])[0]
    return case(draw, seed)
