"""A verdict as verification.json: the one source of every number that reports, tables and figures state about it."""

from typing import TYPE_CHECKING

import numpy as np

from camopt.measure.reserve import STARTS
from camopt.measure.sweep import Band
from camopt.scene.quantities import QUANTITIES
from camopt.verifier.convergence import Converged
from camopt.verifier.outside_speeds import outside_sentence, with_outside

if TYPE_CHECKING:
    from camopt.verifier.at_speed import SpeedVerdict
    from camopt.verifier.verdict import Verdict

REPORTED = tuple(name for name in QUANTITIES if name != "excess_lift_mm")
"""Metrics of verification.json."""


def verification(verdict: "Verdict") -> dict:
    """The content of verification.json (design.md section 7); NaN becomes null.

    `band` is null and `worst_in_band` empty where no band was swept.
    """
    record = {
        "verdict": verdict.verdict,
        "broken": list(verdict.broken),
        "reason": verdict.reason,
        "speeds": [speed_record(s) for s in verdict.speeds],
        "worst_in_band": [speed_record(s) for s in verdict.worst_in_band],
        "band": None if verdict.band is None else band_record(verdict.band),
        "limits": {key: getattr(verdict, key) for key in STARTS},
        "accuracy": verdict.accuracy,
        **({"shape_says": verdict.shape_says} if verdict.shape_says else {}),
    }
    return with_outside(record, [one.as_dict() for one in verdict.outside])


def why_not_confirmed(verdict: "Verdict") -> str:
    """What speaks against a verdict's cam, as a sentence; empty where nothing does."""
    if any(not one.agrees for one in verdict.outside):
        return outside_sentence([one.as_dict() for one in verdict.outside])
    if verdict.verdict == "confirmed":
        return ""
    if verdict.verdict == "rejected":
        return f"The cam breaks {', '.join(verdict.broken)}."
    decisive = [s for s in (*verdict.speeds, *verdict.worst_in_band) if s.verdict == verdict.verdict]
    if verdict.verdict == "not converged":
        at = ", ".join(dict.fromkeys(f"{s.speed_rpm:g}" for s in decisive))
        return f"The methods do not agree, or have not converged, at {at} r/min."
    limits = ", ".join(dict.fromkeys(limit for s in decisive for limit in s.straddled))
    return f"Of the neighbouring speeds, lifts and states some keep and some break {limits}."


def speed_record(speed: "SpeedVerdict") -> dict:
    """One speed: the figures of the method named under `method`, then those of every method."""
    name, first = next(iter(speed.methods.items()))
    return {
        "speed_rpm": speed.speed_rpm,
        "verdict": speed.verdict,
        "decided_after": speed.decided_after,
        "method": name,
        **_figures(first),
        "bounce_range_mm": [_number(b) for b in speed.bounce_range_mm],
        "ranges": _ranges(speed.ranges),
        "methods": {name: _method(answer) for name, answer in speed.methods.items()},
    }


def band_record(band: Band) -> dict:
    """The band: ends and step, the worst value of every metric with its speed and method, and the curves themselves.

    The worst values are those of the curves, which hold the sweep and, at the judged speeds, the first method's
    figures: what a text names is what a figure draws.
    """
    worst = {}
    for name in REPORTED:
        i = band.worst_index(name)
        value, speed = band.figures[name][i], float(band.speeds_rpm[i])
        worst[name] = {"value": _number(value), "speed_rpm": speed, "method": band.methods[i]}
    return {
        "from_rpm": band.from_rpm,
        "to_rpm": band.to_rpm,
        "step_rpm": band.step_rpm,
        "refined": band.refined,
        "worst_bounce_mm": worst["bounce_mm"]["value"],
        "worst_speed_rpm": worst["bounce_mm"]["speed_rpm"],
        "worst": worst,
        "resonances": [
            {
                "speed_rpm": r.speed_rpm,
                "half_width_rpm": r.half_width_rpm,
                "harmonic": r.harmonic,
                "frequency_Hz": r.frequency_Hz,
            }
            for r in band.resonances
        ],
        "resonances_left_out": band.resonances_left_out,
        "curves": {
            "speed_rpm": band.speeds_rpm.tolist(),
            **{name: [_number(v) for v in band.figures[name]] for name in REPORTED},
        },
    }


def _method(answer: Converged) -> dict:
    return {
        **_figures(answer),
        "bounce_range_mm": [_number(b) for b in answer.range["bounce_mm"]],
        "ranges": _ranges(answer.range),
        "steps_per_revolution": answer.steps_per_revolution,
        "converged": answer.converged,
    }


def _figures(answer: Converged) -> dict:
    figures = {name: _number(answer.worst[name]) for name in REPORTED}
    errors = {name: _number(answer.doubt(name)) for name in REPORTED}
    return {
        **figures,
        "bounce_error_mm": errors["bounce_mm"],
        "errors": errors,
        "revolutions": answer.revolutions,
        "periodic": answer.periodic,
    }


def _ranges(ranges: dict[str, tuple[float, float]]) -> dict[str, list[float | None]]:
    return {name: [_number(value) for value in ranges[name]] for name in REPORTED}


def _number(value: float) -> float | None:
    """JSON has no NaN: null."""
    return float(value) if np.isfinite(value) else None
