"""Train and cam read from the files of a run folder, in SI units and radians.

Only these two files of camopt are used. A scene that cannot be expressed here is refused with a sentence.
"""

import json
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

GROUND = -1
MM, DEG, RPM = 1e-3, math.pi / 180.0, math.pi / 30.0
KINDS = "spring", "contact", "adjuster", "friction"
LAWS = "linear", "hertz", "hunt-crossley", "progressive", "table"
KNOWN = {
    "name", "kind", "between", "law", "stiffness_N_per_m", "exponent", "stiffness_table", "force_table",
    "dissipation_s_per_m", "leak_N_s_per_m", "spring_N_per_m", "stroke_mm", "check_travel_mm", "slip_N",
    "damping_N_s_per_m", "preload_N", "gap_mm", "cam_driven", "assumed", "source",
}  # fmt: skip
"""Supported keys of an element."""
KNOWN_OF_A_MASS = {"name", "mass_kg", "damping_N_s_per_m", "force_N", "assumed", "source"}


class OutsideRefused(ValueError):
    """A scene that cannot be expressed here, or a file that cannot be read; the message is one sentence."""


@dataclass(frozen=True)
class FiledElement:
    """An element between the masses a and b (GROUND: -1). `law` is one of LAWS, "plunger", "oil" or "friction"."""

    name: str
    law: str
    a: int
    b: int
    contact: bool
    driven: bool = False
    stiffness: float = 0.0  # N/m, for a hertz or hunt-crossley contact N/m^exponent
    damping: float = 0.0  # N s/m
    preload: float = 0.0  # N
    gap: float = 0.0  # m
    exponent: float = 1.5
    dissipation: float = 0.0  # s/m
    rows: tuple[tuple[float, float], ...] = ()  # compression [m]; stiffness [N/m] if progressive, else force [N]
    leak: float = 0.0  # N s/m
    travel: float = 0.0  # m
    slip: float = 0.0  # N

    @property
    def has_memory(self) -> bool:
        """Whether the element has an internal length, which changes by leakage or sliding."""
        return self.law in ("oil", "friction")


@dataclass(frozen=True)
class FiledTrain:
    """The train of a scene file; `forcing` holds masses with rows of cam angle [rad] and force [N]."""

    mass: tuple[float, ...]
    drag: tuple[float, ...]  # N s/m to ground
    load: tuple[float, ...]  # N
    elements: tuple[FiledElement, ...]
    forcing: tuple[tuple[int, tuple[tuple[float, float], ...]], ...]
    valve: int
    seat: FiledElement
    cam_per_crank: float

    def cam_speed(self, speed_rpm: float) -> float:
        """Speed of the cam [rad/s] at a speed of the crankshaft [r/min]."""
        return speed_rpm * RPM * self.cam_per_crank


@dataclass(frozen=True)
class FiledCam:
    """The lift as polynomial pieces: piece i is the sum of coefficients[i, k] (angle - start[i])^k, in m and rad."""

    start: np.ndarray  # (p)
    coefficients: np.ndarray  # (p, q)
    duration: float  # rad

    def slopes(self) -> np.ndarray:
        """Coefficients (p, q - 1) of the derivative by the angle [m/rad]."""
        return self.coefficients[:, 1:] * np.arange(1, self.coefficients.shape[1])


def read_cam(path: str | Path) -> FiledCam:
    """The cam of a design file. Raises OutsideRefused if the file has no polynomial pieces."""
    content = json.loads(Path(path).read_text(encoding="utf-8"))
    if "pieces" not in content:
        raise OutsideRefused(f"{path}: no pieces of a lift: give a design.json of camopt")
    pieces = content["pieces"]
    length = max(map(len, pieces["coefficients_mm"]))
    rows = np.array([list(c) + [0.0] * (length - len(c)) for c in pieces["coefficients_mm"]])
    scale = MM / DEG ** np.arange(length)
    return FiledCam(np.array(pieces["start_deg"]) * DEG, rows * scale, content["duration_deg"] * DEG)


def read_train(path: str | Path) -> FiledTrain:
    """The train of a scene file. Raises OutsideRefused if the scene cannot be expressed here."""
    scene = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    if "seat" not in scene or "valve" not in scene or "operation" not in scene:
        raise OutsideRefused(f"{path}: the judge from outside needs valve, seat and [operation]")
    masses = scene["mass"]
    for mass in masses:
        _require_known(f"mass {mass['name']}", mass, KNOWN_OF_A_MASS)
    index = {m["name"]: i for i, m in enumerate(masses)} | {"ground": GROUND}
    elements = [element for e in scene["element"] for element in _elements_of(e, index)]
    forcing = tuple(
        (index[f["on"]], tuple((angle * DEG, force) for angle, force in f["table"])) for f in scene.get("force", [])
    )
    return FiledTrain(
        mass=tuple(m["mass_kg"] for m in masses),
        drag=tuple(m.get("damping_N_s_per_m", 0.0) for m in masses),
        load=tuple(m.get("force_N", 0.0) for m in masses),
        elements=tuple(elements),
        forcing=forcing,
        valve=index[scene["valve"]],
        seat=next(e for e in elements if e.name == scene["seat"]),
        cam_per_crank=scene["operation"].get("cam_per_crank", 0.5),
    )


def _require_known(what: str, table: dict[str, Any], keys: set[str]) -> None:
    unknown = sorted(set(table) - keys)
    if unknown:
        raise OutsideRefused(f"{what}: the judge from outside cannot express {', '.join(unknown)}")


def _elements_of(e: dict[str, Any], index: dict[str, int]) -> list[FiledElement]:
    """The elements that represent an element of the scene: a plunger and oil in parallel for an adjuster, else one."""
    _require_known(f"element {e['name']}", e, KNOWN)
    kind, law = e["kind"], e.get("law", "linear")
    if kind not in KINDS or law not in LAWS:
        raise OutsideRefused(f"element {e['name']}: the judge from outside cannot express {kind!r} with law {law!r}")
    name, a, b = e["name"], *(index[end] for end in e["between"])
    stiffness = e.get("stiffness_N_per_m", 0.0)
    if kind == "friction":
        return [FiledElement(name, "friction", a, b, False, stiffness=stiffness, slip=e["slip_N"])]
    if kind == "adjuster":
        travel = e.get("check_travel_mm", 0.0) * MM
        oil = {"stiffness": stiffness, "leak": e["leak_N_s_per_m"], "travel": travel}
        plunger = FiledElement(name, "plunger", a, b, True, rows=_plunger_rows(e))
        return [plunger, FiledElement(f"{name}-oil", "oil", a, b, False, **oil)]
    rows = e.get("stiffness_table") or e.get("force_table") or ()
    element = FiledElement(
        name, law, a, b, kind == "contact",
        driven=e.get("cam_driven", False), stiffness=stiffness, damping=e.get("damping_N_s_per_m", 0.0),
        preload=e.get("preload_N", 0.0), gap=e.get("gap_mm", 0.0) * MM, exponent=e.get("exponent", 1.5),
        dissipation=e.get("dissipation_s_per_m", 0.0), rows=tuple((at * MM, value) for at, value in rows),
    )  # fmt: skip
    return [element]


def _plunger_rows(e: dict[str, Any]) -> tuple[tuple[float, float], ...]:
    """Force [N] over compression [m] of an adjuster's plunger spring: soft within the stroke, stops at both ends."""
    half, stop = e["stroke_mm"] * MM / 2, e["stiffness_N_per_m"]
    least, most = (e["preload_N"] + side * half * e["spring_N_per_m"] for side in (-1, 1))
    return (-half - least / stop, 0.0), (-half, least), (half, most), (half + MM, most + stop * MM)
