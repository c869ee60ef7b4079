"""`design.json`: the pieces of a cam's lift in millimetres and degrees, without loss in either direction."""

import json
from functools import lru_cache
from itertools import zip_longest
from pathlib import Path

import numpy as np

from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene
from camopt.scene.text_file import read_text
from camopt.scene.units import DEG, MM
from camopt.storage import write_json

MAX_FILE_BYTES = 50_000_000
BORDER_SLACK_DEG = 1e-9
STEP_SLACK_MM = 1e-6
"""Step in lift [mm] between two pieces that counts as rounding; a cam has no larger one."""


def design_record(lift: Lift, max_lift: float, **further: object) -> dict:
    """The content of `design.json` for a lift law, with the area ratio for a maximum lift [m] and any further keys."""
    powers = np.arange(lift.coefficients.shape[1])
    degrees = lift.borders / DEG
    return {
        "family": lift.family,
        "parameters": lift.parameters,
        "duration_deg": 2 * lift.half_duration / DEG,
        "highest_lift_mm": lift.max_lift / MM,
        "area_mm_deg": lift.area / MM / DEG,
        "area_ratio": lift.area_ratio(max_lift),
        **further,
        "pieces": {
            "start_deg": degrees[:-1],
            "end_deg": degrees[1:],
            "coefficients_mm": lift.coefficients * DEG**powers / MM,
        },
    }


def write_design(path: str | Path, lift: Lift, max_lift: float, **further: object) -> None:
    """Writes `design.json` (see `design_record`)."""
    write_json(path, design_record(lift, max_lift, **further))


def read_design(path: str | Path, scene: Scene) -> Lift:
    """The lift law of a `design.json`; without a duration_deg in the file, it has the duration of the scene.

    Raises InputError for a file that is not a design: unreadable, not JSON, with missing or malformed pieces, or with
    pieces that do not cover -180 to 180 deg or have a step in lift.
    """
    return lift_of_text(read_text(Path(path), MAX_FILE_BYTES, "design"), scene, path)


@lru_cache(maxsize=8)  # the same file gives the same object, for which results are cached
def lift_of_text(text: str, scene: Scene, path: object) -> Lift:
    """The lift law in the text of a `design.json`; `path` begins the error sentences. Errors as for `read_design`."""
    data = _json_object(text, path)
    try:
        pieces = data["pieces"]
        start, end = (np.array(pieces[k], dtype=float) for k in ("start_deg", "end_deg"))
        rows = [np.array(row, dtype=float) for row in pieces["coefficients_mm"]]
        if any(row.ndim != 1 or not 1 <= len(row) <= 64 for row in rows):
            raise ValueError("coefficients_mm needs a list of 1 to 64 numbers per piece")
        coefficients = np.array([*zip_longest(*rows, fillvalue=0.0)]).T
        duration = float(data.get("duration_deg", scene.required_design.duration_deg))
        family, parameters = str(data.get("family", "lift")), dict(data.get("parameters") or {})
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: not a design.json of camopt: {what}") from None
    if start.ndim != 1 or not len(start) == len(end) == len(coefficients) > 0:
        raise InputError(f"{path}: pieces: start_deg, end_deg and coefficients_mm must be lists of equal length")
    borders = np.append(start, end[-1])
    if not all(np.all(np.isfinite(a)) for a in (start, end, coefficients)):
        raise InputError(f"{path}: pieces: every number must be finite")
    gaps = np.abs(np.concatenate([[borders[0] + 180], end[:-1] - start[1:], [borders[-1] - 180]]))
    if gaps.max() > BORDER_SLACK_DEG or np.any(np.diff(borders) <= 0):
        raise InputError(f"{path}: pieces must cover -180 to 180 deg in ascending order without gap")
    if not 0 < duration < 360:
        raise InputError(f"{path}: duration_deg {duration:g} must lie between 0 and 360")
    powers = np.arange(coefficients.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        ends = np.sum(coefficients * np.diff(borders)[:, None] ** powers, axis=1)
        step = np.nan_to_num(np.abs(np.roll(ends, 1) - coefficients[:, 0]), nan=np.inf)
    if step.max() > STEP_SLACK_MM:
        where = start[int(np.argmax(step))]
        raise InputError(
            f"{path}: pieces: the lift steps by {step.max():.3g} mm at {where:g} deg; let "
            f"the pieces join, as a cam's lift is smooth"
        )
    return _lift(borders, coefficients, duration, family, parameters)


def as_written(lift: Lift) -> Lift:
    """The lift law as its `design.json` returns it, bit by bit. The conversion of units changes the last digits, and a
    motion in which contacts separate amplifies the difference, so the cam is verified as it is stored."""
    record = design_record(lift, lift.max_lift)
    pieces = record["pieces"]
    borders = np.append(pieces["start_deg"], pieces["end_deg"][-1])
    return _lift(borders, pieces["coefficients_mm"], record["duration_deg"], lift.family, lift.parameters)


def _lift(borders_deg: np.ndarray, coefficients_mm: np.ndarray, duration_deg: float, family, parameters) -> Lift:
    """The lift law of pieces in millimetres and degrees."""
    borders, powers = borders_deg.copy(), np.arange(coefficients_mm.shape[1])
    borders[[0, -1]] = -180.0, 180.0
    return Lift(borders * DEG, coefficients_mm * MM / DEG**powers, duration_deg * DEG / 2, family, parameters)


def _json_object(text: str, path: object) -> dict:
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON: {error}") from error
    except ValueError:  # Python limits an integer to a few thousand digits
        raise InputError(
            f"{path}: an integer of thousands of digits, which no design has: write the design again"
        ) from None
    if not isinstance(data, dict):
        raise InputError(f"{path}: not a design.json of camopt: an object with `pieces` is expected")
    return data
