"""An edited scene: the designer's scene with the dragged numbers, checked as a file would be."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from camopt.designer.controls import DESIGN, NO_JUMP, Control, lash_element, tolerance_key
from camopt.scene.errors import InputError
from camopt.scene.faults import checked
from camopt.scene.parameters import SceneNumber, with_numbers, with_spring
from camopt.scene.schema import Scene
from camopt.scene.table import LARGEST
from camopt.scene.text_file import excerpt

NEEDED = ("valve", "seat", "operation", "design")
LONGEST_KEY = 80
"""Letters of an unknown key that are said again."""
BAND = ("band_low_rpm", "band_high_rpm")


class Refused(InputError):
    """Numbers that make no scene: a sentence by the key beside which it belongs; "" where it is of several."""

    def __init__(self, faults: Mapping[str, str]):
        super().__init__("; ".join(f"{key}: {sentence}" if key else sentence for key, sentence in faults.items()))
        self.faults = dict(faults)


@dataclass(frozen=True)
class Asked:
    """What values ask for beside the scene: which linear program, its margin [N], and the speed shown [r/min]."""

    program: str
    margin_N: float
    speed_rpm: float


def read_values(controls: Mapping[str, Control], values: object) -> dict[str, Any]:
    """Every control's value by key: those given, else the scene's. Raises Refused, with a sentence by key."""
    if not isinstance(values, Mapping):
        raise Refused({"": f"values: expected an object of numbers by key (given: {excerpt(str(values))})"})
    faults = {str(key)[:LONGEST_KEY]: "unknown key" for key in values if key not in controls}
    found = {}
    for key, control in controls.items():
        value = values.get(key, control.value)
        sentence = _fault(control, value)
        if sentence:
            faults[key] = sentence
        else:
            found[key] = float(value) if isinstance(value, int) and not isinstance(value, bool) else value
    if faults:
        raise Refused(faults)
    return found


def _fault(control: Control, value: Any) -> str:
    """Why a value is none for this control; empty where it is one."""
    if control.choices:
        return "" if value in control.choices else f"expected one of {', '.join(control.choices)}"
    if isinstance(control.value, bool):
        return "" if isinstance(value, bool) else "expected true or false"
    if value is None:
        return "" if control.optional else "a number is needed"
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or abs(value) > LARGEST
        or not math.isfinite(value)
    ):
        return f"expected a number (given: {excerpt(str(value))})"
    return ""


def asked_of(values: Mapping[str, Any]) -> Asked:
    """What the values ask for beside the scene. Raises Refused for a speed that is none."""
    if not values["speed_rpm"] > 0:
        raise Refused({"speed_rpm": "a speed above 0 r/min is needed"})
    return Asked(values["program"], values["margin_N"] if values["program"] == NO_JUMP else 0.0, values["speed_rpm"])


def edited_scene(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with the values of `read_values`; raises Refused where the schema refuses them."""
    for key, least in (("spring_rate_percent", 1.0), ("spring_preload_percent", 0.0), ("lash_mm", 0.0)):
        if values.get(key, least) < least:
            raise Refused({key: f"must be at least {least:g}"})
    edited = _with_train(scene, values)
    assert edited.design is not None and edited.operation is not None, "load_scene(..., need=...) guarantees both"
    design = edited.design.model_copy(update={key: values[key] for key in (*DESIGN, "reach_max_lift")})
    operation = edited.operation.model_copy(update={"band_rpm": tuple(values[key] for key in BAND)})
    edited = edited.model_copy(update={"design": design, "operation": operation, **_as_built(scene, values)})
    data = edited.model_dump(exclude_none=True, exclude_defaults=True)
    found, faults = checked(data, NEEDED)
    if found is None or faults:
        raise Refused(_by_key(faults))
    return found


def _with_train(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """The scene with the spring and the lash of the values."""
    factors = [values.get(f"spring_{number}_percent", 100.0) / 100.0 for number in ("rate", "preload")]
    if factors != [1.0, 1.0]:
        scene = with_spring(scene, *factors)
    lash = SceneNumber("element", lash_element(scene), "gap_mm")
    if values.get("lash_mm", lash.of(scene)) == lash.of(scene):
        return scene
    return with_numbers(scene, {lash: values["lash_mm"]})


def _as_built(scene: Scene, values: Mapping[str, Any]) -> dict[str, Any]:
    """Tolerances and grinding error of the values; what is switched off is left out."""
    rows = []
    for tolerance in scene.tolerance:
        width = values[tolerance_key(tolerance)]
        key = "relative" if tolerance.relative is not None else "plus_minus"
        if width is not None:
            rows.append(tolerance.model_copy(update={key: width}))
    found: dict[str, Any] = {"tolerance": tuple(rows)}
    if scene.grinding is not None:
        error = values["grinding_error_um"]
        found["grinding"] = None if error is None else scene.grinding.model_copy(update={"error_um": error})
    return found


def _by_key(faults: list[str]) -> dict[str, str]:
    """The schema's sentences by the control that they belong to; those of several share the empty key."""
    found: dict[str, list[str]] = {}
    for fault in faults:
        place, _, sentence = fault.partition(": ")
        table, _, key = place.partition(".")
        known = key if table == "design" and key in DESIGN else BAND[1] if place == "operation.band_rpm" else ""
        found.setdefault(known, []).append(sentence if known else fault)
    return {key: "; ".join(sentences) for key, sentences in found.items()}
