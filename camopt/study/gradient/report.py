"""`camopt gradient`: whether the gradients of a cam at a speed can be trusted.

Gradients with respect to the heights of bumps on the cam are compared, metric by metric, with central differences of
the true motion at several heights. The true motion is event-exact. Where a law is curved it is DOP853, because
event-exact then uses chords, whose relative slope error decreases only with their number. All motions start from one
state; its dependence on the cam is neglected. docs/explanation/gradients.md explains the report.
"""

from itertools import pairwise

import numpy as np
from tqdm import tqdm

from camopt.cam.lift import Lift
from camopt.scene import MotionRefused, Scene, build_train
from camopt.smooth.simulate import EPS
from camopt.study.gradient import paths

MOST_ERROR, LEAST_COSINE, MOST_DISAGREEMENT = 1e-2, 0.9, 0.1
STILL = 1e-9
"""Change of a metric by the largest height, in its unit, below which the metric counts as constant."""
BUMPS = {True: 20, False: 4}
"""Number of bumps for piecewise linear laws (True) and curved ones (False), whose truth takes a second a motion."""
HEIGHTS = {True: tuple((10.0 ** np.arange(-5.0, -9.6, -0.5)).tolist()), False: (1e-5, 1e-6, 1e-7)}
"""Heights of a bump [m] for central differences."""
WIDTHS = 1e-5, 1e-6, 1e-7, EPS
"""Widths eps [m] of the smooth path's contact layer."""
TRUTH = {True: "event-exact motion", False: "DOP853 with located switchings, since a law is curved"}
"""The motion whose differences are taken."""


def gradient_report(
    scene: Scene,
    lift: Lift,
    speed_rpm: float,
    *,
    bumps: int | None = None,
    widths: tuple[float, ...] = WIDTHS,
    progress: bool = False,
) -> dict:
    """Judges the gradients of a cam in a scene at a crankshaft speed [r/min] (see the module). Returns the content of
    `gradient --json` (docs/run-folder.md).

    `widths` [m] of the smooth path's layer include the default `EPS`. Raises MotionRefused and InputError as the
    methods.
    """
    straight = build_train(scene).straight
    heights, count = HEIGHTS[straight], bumps or BUMPS[straight]
    with tqdm(total=len(heights) + len(widths) + 2, disable=None if progress else True, unit="part") as bar:
        p = paths.problem(scene, lift, speed_rpm, count)
        bar.update()
        exact, together = paths.exact_gradients(p)
        bar.update()
        differences = []
        for height in heights:
            differences.append(central_differences(p, height))
            bar.update()
        run, smooth = paths.smooth_gradients(p), {}
        for eps in widths:
            smooth[eps] = run(eps)
            bar.update()
    truth, differences = paths.true_values(p, np.zeros(count)), np.array(differences)
    repeated = [None] * len(paths.METRICS) if p.settled else list(paths.repeated_cosines(p, exact.gradients))
    metrics = {
        name: judge(i, truth[i], differences[:, i], heights, exact, smooth, repeated[i])
        for i, name in enumerate(paths.METRICS)
    }
    return {
        "speed_rpm": speed_rpm,
        "bumps": count,
        "heights_m": heights,
        "settled": p.settled,
        "truth": TRUTH[straight],
        "grazing": vars(together.grazing),
        "spectral_radius": paths.spectral_radius(p),
        "metrics": metrics,
    }


def central_differences(p: paths.Problem, height: float) -> np.ndarray:
    """Central differences (l, m) of the true METRICS by every bump of `height` [m]; NaN where a motion is refused."""

    def values(heights: np.ndarray) -> np.ndarray:
        try:
            return paths.true_values(p, heights)
        except MotionRefused:
            return np.full(len(paths.METRICS), np.nan)

    units = height * np.eye(len(p.directions))
    return np.stack([(values(e) - values(-e)) / (2.0 * height) for e in units], axis=-1)


def judge(
    i: int,
    truth: float,
    differences: np.ndarray,
    heights: tuple[float, ...],
    exact: paths.PathGradients,
    smooth: dict[float, paths.PathGradients],
    repeated: float | None,
) -> dict:
    """The report on metric number i, as in `gradient --json`, from the differences (h, m) by the bumps at the heights
    (h) [m]; `repeated` is as in `verdict`."""
    still = truth == 0.0 and bool(np.all(np.abs(differences[0]) * heights[0] < STILL))
    agreement = disagreement(differences)
    unusable = still or not agreement <= MOST_DISAGREEMENT

    def errors(path: paths.PathGradients) -> np.ndarray:
        return relative_errors(path.gradients[i], differences)

    def judged(path: paths.PathGradients) -> dict:
        error, cosine, value, at_heights = np.nan, np.nan, path.values[i], errors(path)
        if np.any(np.isfinite(at_heights)) and not still:
            best = int(np.nanargmin(at_heights))
            error, cosine = at_heights[best], paths.cosine(path.gradients[i], differences[best])
        return {
            "value_bias": abs(value / truth - 1.0) if truth != 0.0 else 0.0 if value == 0.0 else np.nan,
            "relative_error": error,
            "cosine": cosine,
            "cost_ratio": path.cost_ratio[i],
            "verdict": "none" if unusable else verdict(error, cosine, repeated),
        }

    by_exact = judged(exact)
    return {
        "value": float(truth),
        "exact": by_exact,
        "smooth": [{"eps_m": eps, **judged(path)} for eps, path in smooth.items()],
        "agreement": agreement,
        "relative_error_at_heights": {"exact": errors(exact), "smooth": errors(smooth[EPS])},
        "verdict": by_exact["verdict"],
        "reason": _reason(truth, still, agreement, repeated),
    }


def verdict(relative_error: float, cosine: float, repeated: float | None = None) -> str:
    """The verdict "trust", "direction only" or "none" from a gradient's error and cosine.

    `repeated` is its least cosine with the gradients of the next revolutions, None for a periodic motion.
    """
    if repeated is None and relative_error <= MOST_ERROR:
        return "trust"
    alike = repeated is None or repeated >= LEAST_COSINE
    return "direction only" if cosine >= LEAST_COSINE and alike else "none"


def relative_errors(gradient: np.ndarray, differences: np.ndarray) -> np.ndarray:
    """Relative errors (h) of a gradient (m) against the differences (h, m) at every height; infinite where the
    differences are zero and the gradient is not, NaN where a value is NaN."""
    distance, size = np.linalg.norm(gradient - differences, axis=1), np.linalg.norm(differences, axis=1)
    return np.where(size > 0.0, distance / np.where(size > 0.0, size, 1.0), np.where(distance > 0.0, np.inf, distance))


def disagreement(differences: np.ndarray) -> float:
    """Smallest relative change of the differences (h, m) between neighbouring heights; NaN without values."""
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


def report_lines(report: dict) -> list[str]:
    """The report as lines of text."""
    heights, grazing = ", ".join(f"{h:.0e}" for h in report["heights_m"]), report["grazing"]
    lines = [
        f"against central differences of {report['truth']}",
        f"by {report['bumps']} bumps of {heights} m on the lift",
        f"trust: error <= {MOST_ERROR:g} in a motion that repeats itself; direction only: cosine >= {LEAST_COSINE:g}",
        "the motion repeats itself" if report["settled"] else "the motion does not repeat itself",
        f"nearest grazing: closing at {grazing['approach_m_per_s']:.2g} m/s, missed by {grazing['gap_m']:.2g} m",
        f"spectral radius of the cycle map: {report['spectral_radius']:.3g}",
    ]
    for name, metric in report["metrics"].items():
        reason = metric["reason"]
        lines += ["", f"{name} = {metric['value']:.6g}: {metric['verdict']}" + (f" ({reason})" if reason else "")]
        if reason.startswith(("no value", "zero")):
            continue
        lines += [f"  {'path':<16} {'value bias':>10} {'relative error':>14} {'cosine':>8} {'cost':>5}  verdict"]
        for judged in (metric["exact"], *metric["smooth"]):
            label = f"smooth {judged['eps_m']:.0e} m" if "eps_m" in judged else "exact"
            numbers = f"{judged['relative_error']:14.1e} {judged['cosine']:8.4f} {judged['cost_ratio']:5.2f}"
            lines += [f"  {label:<16} {judged['value_bias']:10.1e} {numbers}  {judged['verdict']}"]
        for path, errors in metric["relative_error_at_heights"].items():
            label = path if path == "exact" else f"smooth {EPS:.0e} m"
            lines += [f"  {label} at each height: {' '.join(f'{e:.1e}' for e in errors)}"]
    return lines
