"""The verdict on a gradient, from central differences at several heights (see `camopt.study.gradient.report`)."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from camopt.smooth.simulate import EPS
from camopt.study.gradient.paths import Found, cosine

MOST_ERROR, LEAST_COSINE, MOST_DISAGREEMENT = 1e-2, 0.9, 0.1
STILL = 1e-9
"""A metric that the largest height changes by less than this, in its unit, does not move."""


@dataclass(frozen=True)
class JudgedMetric:
    """How a gradient of one metric compares with the differences."""

    relative_error: float
    cosine: float
    cost_ratio: float
    verdict: str  # trust, direction only, none
    at_height: np.ndarray  # relative error at each height

    def as_dict(self) -> dict:
        return {name: getattr(self, name) for name in ("relative_error", "cosine", "cost_ratio", "verdict")}


@dataclass(frozen=True)
class MetricReport:
    """One metric: its true value, what its differences say, and every gradient judged."""

    value: float
    agreement: float
    exact: JudgedMetric
    exact_bias: float
    smooth: dict[float, JudgedMetric]  # by eps [m]
    value_bias: dict[float, float]
    verdict: str
    reason: str

    def as_dict(self) -> dict:
        smooth = [{"eps_m": e, "value_bias": self.value_bias[e], **j.as_dict()} for e, j in self.smooth.items()]
        return {
            "value": self.value,
            "exact": {"value_bias": self.exact_bias, **self.exact.as_dict()},
            "smooth": smooth,
            "agreement": self.agreement,
            "relative_error_at_heights": {
                "exact": self.exact.at_height,
                "smooth": self.smooth[EPS].at_height,
            },
            "verdict": self.verdict,
            "reason": self.reason,
        }


def judge(
    i: int,
    truth: float,
    differences: np.ndarray,
    heights: tuple[float, ...],
    exact: Found,
    smooth: dict[float, Found],
    repeated: float | None,
) -> MetricReport:
    """Report on metric number i with the differences (h, m) by bumps at the heights (h) [m].

    `repeated` is the least cosine with the revolutions that follow, None for a motion that repeats itself.
    """
    still = truth == 0.0 and bool(np.all(np.abs(differences[0]) * heights[0] < STILL))
    agreement = disagreement(differences)
    reason = _reason(truth, still, agreement, repeated)

    def judged(found: Found) -> JudgedMetric:
        error = relative_errors(found.gradients[i], differences)
        best = int(np.nanargmin(error)) if np.any(np.isfinite(error)) and not still else -1
        least, turn = (error[best], cosine(found.gradients[i], differences[best])) if best >= 0 else (np.nan, np.nan)
        rough = still or not agreement <= MOST_DISAGREEMENT
        return JudgedMetric(
            least, turn, found.cost_ratio[i], "none" if rough else verdict(least, turn, repeated), error
        )

    by_exact, by_eps = judged(exact), {eps: judged(found) for eps, found in smooth.items()}
    of_exact, *of_eps = (_bias(found.values[i], truth) for found in (exact, *smooth.values()))
    biases = dict(zip(smooth, of_eps, strict=True))
    return MetricReport(float(truth), agreement, by_exact, of_exact, by_eps, biases, by_exact.verdict, reason)


def verdict(relative_error: float, cosine: float, repeated: float | None = None) -> str:
    """trust, direction only or none, from a gradient's error and cosine.

    `repeated` is the least cosine with the revolutions that follow, None for a motion that repeats itself.
    """
    if repeated is None and relative_error <= MOST_ERROR:
        return "trust"
    alike = repeated is None or repeated >= LEAST_COSINE
    return "direction only" if cosine >= LEAST_COSINE and alike else "none"


def relative_errors(gradient: np.ndarray, differences: np.ndarray) -> np.ndarray:
    """Relative errors (h) of a gradient (m) against the differences (h, m) at every height.

    They are infinite where the differences are zero and the gradient is not.
    """
    off, size = np.linalg.norm(gradient - differences, axis=1), np.linalg.norm(differences, axis=1)
    return np.where(size > 0.0, off / np.where(size > 0.0, size, 1.0), np.where(off > 0.0, np.inf, 0.0))


def disagreement(differences: np.ndarray) -> float:
    """Smallest relative change of the differences (h, m) from one height to the next; NaN without values."""
    steps = [relative_errors(a, b[None])[0] for a, b in pairwise(differences)]
    return float(np.nanmin(steps)) if np.any(np.isfinite(steps)) else float("nan")


def _reason(truth: float, still: bool, agreement: float, repeated: float | None) -> str:
    if not np.isfinite(truth):
        return "no value: the valve never seats"
    if still:
        return "zero all around: nothing to follow"
    if not agreement <= MOST_DISAGREEMENT:
        return "differences agree at no height: rough at every scale"
    if repeated is None:
        return ""
    return f"the motion does not repeat itself: least cosine with its gradients in the next revolutions {repeated:.4f}"


def _bias(value: float, truth: float) -> float:
    if truth == 0.0:
        return 0.0 if value == 0.0 else float("nan")
    return abs(value / truth - 1.0)
