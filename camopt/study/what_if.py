"""The effect of other numbers in a scene: on a cam, before and after, and on a cam designed for the changed scene."""

from collections.abc import Mapping

from camopt.cam.lift import Lift
from camopt.optimizer.accuracy import accuracy_named
from camopt.optimizer.as_built.checks import has_a_yield
from camopt.optimizer.candidates import family_cams, full_verdict, largest_confirmed
from camopt.optimizer.search.search import find_cam
from camopt.scene import InputError, Scene
from camopt.scene.load import checked_scene
from camopt.scene.parameters import TABLES, no_such_number, settable, with_numbers
from camopt.scene.schema import SIMULATED
from camopt.scene.units import DEG, MM
from camopt.study.yields import manufacturing_yield
from camopt.verifier import DRAFT

ROWS = (
    ("cam", "cam", "s"),
    ("verdict", "verdict", "s"),
    ("area ratio", "area_ratio", ".5f"),
    ("area [mm deg]", "area_mm_deg", ".2f"),
    ("jump exceeds its limit from [r/min]", "first_jump_rpm", ".0f"),
    ("bounce exceeds its limit from [r/min]", "first_bounce_rpm", ".0f"),
    ("yield [%]", "yield_percent", ".1f"),
)


def what_if(
    scene: Scene, cam: Lift, changes: Mapping[str, tuple[bool, float]], *, redesign: bool = False, trains: int = 100
) -> dict:
    """The effect of all `changes` together on a cam, and with `redesign` also a cam designed for them. Returns the
    content of `what-if --json`: the changed numbers, from and to, and the `outcome` of each cam.

    The keys of `changes` are NAME.KEY of a mass or an element ("*" as NAME: each that has the key), or a key of
    [design], [operation] or [geometry] as design.KEY; the values are whether the number is a factor on the scene's
    value, and the number. The yield is that of `trains` drawn trains. Raises InputError for a name that the scene does
    not have, and for numbers that make the scene invalid.
    """
    after, changed = changed_scene(scene, changes)
    content: dict[str, dict] = {"changed": {name: {"from": was, "to": now} for name, (was, now) in changed.items()}}
    content |= {"as_given": outcome(scene, cam, trains), "with_the_change": outcome(after, cam, trains)}
    if redesign:
        effort = accuracy_named(DRAFT)
        try:
            search = find_cam(after, "band", effort)
            chosen = largest_confirmed(after, search.confirmed, "band", effort, family_cams(after))
            content["redesigned"] = outcome(after, chosen.cam.lift, trains)
        except InputError as error:
            no_cam = {"cam": "none", "verdict": "none holds", "says": str(error)}
            content["redesigned"] = dict.fromkeys(key for _, key, _ in ROWS) | no_cam
    return content


def what_if_lines(content: dict) -> list[str]:
    """The changed numbers, then a table with a column for each cam, then the reason where there is no cam."""
    cams = {name.replace("_", " "): entry for name, entry in content.items() if name != "changed"}
    lines = [f"{name}: {entry['from']:.6g} -> {entry['to']:.6g}" for name, entry in content["changed"].items()]
    width = max(len(label) for label, _, _ in ROWS)
    lines.append(f"{'':<{width}}" + "".join(f"  {name:>15}" for name in cams))
    for label, key, digits in ROWS:
        cells = ["–" if entry[key] is None else format(entry[key], digits) for entry in cams.values()]
        lines.append(f"{label:<{width}}" + "".join(f"  {cell:>15}" for cell in cells))
    return [*lines, *(f"{name}: {entry['says']}" for name, entry in cams.items() if entry["says"])]


def changed_scene(
    scene: Scene, changes: Mapping[str, tuple[bool, float]]
) -> tuple[Scene, dict[str, tuple[float, float]]]:
    """The scene with the changes of `what_if`, checked as a file would be, and each number before and after."""
    changed: dict[str, tuple[float, float]] = {}
    after = scene
    for name, (factor, value) in changes.items():
        numbers = [number for number in settable(after, name) if number.of(after) is not None]
        if not numbers:
            raise no_such_number(scene, name, "--set", [f"{table}.KEY" for table in TABLES])
        values = {number: number.of(after) * value if factor else value for number in numbers}
        changed |= {number.named(after): (number.of(after), new) for number, new in values.items()}
        after = with_numbers(after, values)
    return checked_scene(after, f"{scene.name} with the change", SIMULATED), changed


def outcome(scene: Scene, cam: Lift, trains: int) -> dict:
    """The results of a cam in a scene: its verdict over the band at accuracy draft, the speeds at which jump and bounce
    begin (None: not below 1.5 times the band's top), and the share of trains as built that hold (None for a scene
    without scatter); `says` is empty, or the reason why there is no cam."""
    verdict = full_verdict(scene, cam, "band", accuracy_named(DRAFT))
    return {
        "cam": cam.family,
        "verdict": verdict.verdict,
        "area_ratio": cam.area_ratio_in(scene.required_design),
        "area_mm_deg": cam.area / MM / DEG,
        "first_jump_rpm": verdict.first_jump_rpm,
        "first_bounce_rpm": verdict.first_bounce_rpm,
        "yield_percent": 100 * manufacturing_yield(scene, cam, trains).share.share if has_a_yield(scene) else None,
        "says": "",
    }
