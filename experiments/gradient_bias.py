"""How do the width of the contact's layer, the step and the precision affect values and gradients of the smooth path?

The seating velocity of a Polydyne cam and its gradient by bumps on the lift are computed at four speeds and compared
with central differences of the event-exact motion (with several heights, of which the one that agrees best is used).
Settings that fail are kept in the table as NaN, which JSON writes as null.
"""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.polydyne import polydyne
from camopt.plots.style import LIMIT
from camopt.scene import load_scene
from camopt.smooth.laws import Layer
from camopt.smooth.simulate import TOLERANCE, response_arrays
from camopt.smooth.system import build_system
from experiments.support.gradient_bumps import METRIC, Problem, against, exact_differences, exact_value, problem
from experiments.support.panels import POINTS, Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

SPEEDS = {"small": (5000.0, 7000.0), "full": (5000.0, 6000.0, 6500.0, 7000.0)}
BUMPS = {"small": 3, "full": 10}
EPS = {"small": (1e-6, 2e-9), "full": (1e-5, 1e-6, 1e-7, 1e-8, 2e-9)}
GRIDS = {"small": ("refined",), "full": ("refined", 2880, 11520, 46080)}
"""A grid that is refined at the default tolerance, or a number of equal steps per revolution."""
TOLERANCE_32 = 1e-8
"""Tolerance of the refined grid [m] in single precision, in which positions of 9 mm are rounded by 1e-9 m."""
FLOOR, TOP = 1e-7, 1e2
"""Range of errors in the figure."""


def main(size: str, folder=RESULTS) -> dict:
    """The table of all settings; small: two speeds, three bumps, two widths, the refined grid."""
    scene = load_scene("kodama")
    p = problem(scene, polydyne(scene, (2, 6, 10, 14, 18), design_speed_rpm=7000), SPEEDS[size], BUMPS[size])
    truth = [(exact_value(p, p.lift, s), exact_differences(p, s)) for s in range(len(p.speeds_rpm))]
    settings = [(grid, "float64") for grid in GRIDS[size]] + [("refined", "float32")]
    rows = []
    for grid, precision in settings:
        run = compiled(p, grid, precision)
        for eps in EPS[size]:
            for s, (value, differences) in enumerate(truth):
                smooth, gradient = (np.asarray(q, float) for q in run(eps, s))
                if not np.isfinite(smooth):  # without a value there is no gradient
                    gradient = np.full_like(gradient, np.nan)
                row = {"speed_rpm": p.speeds_rpm[s], "eps_m": eps, "grid": str(grid), "precision": precision}
                rows.append({**row, "value_bias": abs(float(smooth) / value - 1.0), **against(gradient, differences)})
    content = {"metric": METRIC, "bumps": BUMPS[size], "exact_m_per_s": [v for v, _ in truth], "rows": rows}
    return write_result("gradient_bias", size, content, {} if size == "small" else {"eps": figure(rows)}, folder)


def compiled(p: Problem, grid: str | int, precision: str):
    """Value and gradient (m) as a function of eps and the index of the speed: one program per grid and precision."""
    dtype = jnp.dtype(precision)
    system = build_system(p.train, dtype)
    under = p.under(system)
    steps, refine = (8192, True) if grid == "refined" else (int(grid), False)
    tolerance = TOLERANCE if precision == "float64" else TOLERANCE_32

    def value(z, eps, speed, y0):
        motion = response_arrays(under(z, speed), y0, Layer(eps), tolerance, steps=steps, refine=refine)
        return p.metric(system, motion, speed, eps)

    program = jax.jit(jax.value_and_grad(value))

    def run(eps: float, s: int):
        speed, y0 = (jnp.asarray(q, dtype) for q in p.at(s))
        return program(jnp.zeros(len(p.bumps), dtype), jnp.asarray(eps, dtype), speed, y0)

    return run


def figure(rows: list[dict]) -> Figure:
    """Value bias (upper row) and gradient error (lower) against eps, a column per speed; failures at the upper edge."""
    speeds = sorted({row["speed_rpm"] for row in rows})
    kinds = list(dict.fromkeys((row["grid"], row["precision"]) for row in rows))
    names = "seating velocity:\nrelative error of the value", "relative error of the gradient\n(x: NaN)"
    grid = []
    for key, ylabel in zip(("value_bias", "relative_error"), names, strict=True):
        grid.append([])
        for speed in speeds:
            curves = []
            for kind in kinds:
                here = [r for r in rows if r["speed_rpm"] == speed and (r["grid"], r["precision"]) == kind]
                eps, shown = (np.array([r[name] for r in here], dtype=float) for name in ("eps_m", key))
                name = f"{'refined grid' if kind[0] == 'refined' else kind[0] + ' equal steps'}, {kind[1]}"
                failed = eps[~np.isfinite(shown)]
                curves += [(name, eps, np.clip(shown, FLOOR, TOP)), ("NaN", failed, np.full(len(failed), TOP))]
            title = f"{speed:g} r/min" if key == "value_bias" else ""
            grid[-1].append(Panel(ylabel if speed == speeds[0] else "", curves, title, (FLOOR / 2, TOP * 2)))
    look = {"NaN": POINTS | {"marker": "x", "color": LIMIT}}
    width, log = 3.0 * len(speeds), ("log", "log")
    return panels(grid, "width of the layer [m]", None, width, 2.2, sharey=True, scale=log, marker="o", look=look)


if __name__ == "__main__":
    run_script(main, __doc__)
