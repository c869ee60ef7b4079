"""The verdict on a gradient, from central differences at several heights (see `camopt.study.gradient.report`)."""

from itertools import pairwise

import numpy as np

from camopt.smooth.simulate import EPS
from camopt.study.gradient.paths import PathGradients, cosine

MOST_ERROR, LEAST_COSINE, MOST_DISAGREEMENT = 1e-2, 0.9, 0.1
STILL = 1e-9
"""A metric that the largest height changes by less than this, in its unit, does not move."""


def judge(
    i: int,
    truth: float,
    differences: np.ndarray,
    heights: tuple[float, ...],
    exact: PathGradients,
    smooth: dict[float, PathGradients],
    repeated: float | None,
) -> dict:
    """Report on metric number i with the differences (h, m) by bumps at the heights (h) [m], as `gradient --json` has
    it.

    `repeated` is the least cosine with the revolutions that follow, None for a motion that repeats itself.
    """
    still = truth == 0.0 and bool(np.all(np.abs(differences[0]) * heights[0] < STILL))
    agreement = disagreement(differences)
    rough = still or not agreement <= MOST_DISAGREEMENT

    def judged(path: PathGradients) -> tuple[dict, np.ndarray]:
        errors = relative_errors(path.gradients[i], differences)
        best = int(np.nanargmin(errors)) if np.any(np.isfinite(errors)) and not still else -1
        least, turn = (errors[best], cosine(path.gradients[i], differences[best])) if best >= 0 else (np.nan, np.nan)
        said = "none" if rough else verdict(least, turn, repeated)
        bias, cost = _bias(path.values[i], truth), path.cost_ratio[i]
        return {
            "value_bias": bias, "relative_error": least, "cosine": turn, "cost_ratio": cost, "verdict": said
        }, errors  # fmt: skip

    (by_exact, exact_errors), by_eps = judged(exact), {eps: judged(path) for eps, path in smooth.items()}
    return {
        "value": float(truth),
        "exact": by_exact,
        "smooth": [{"eps_m": eps, **one} for eps, (one, _) in by_eps.items()],
        "agreement": agreement,
        "relative_error_at_heights": {"exact": exact_errors, "smooth": by_eps[EPS][1]},
        "verdict": by_exact["verdict"],
        "reason": _reason(truth, still, agreement, repeated),
    }


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
