"""How accurate is every method on the fixed problems, and with which power of the step does its error fall?

The table of `experiments.support.problems`, which the tests hold every method to: the motion of one mass over one
revolution against a formula, or event-exact at finer samples. Steps grow tenfold up to the number of the table.
"""

import time

import numpy as np
from matplotlib.figure import Figure

from camopt.plots.style import new_figure, styled
from camopt.scene.units import UM
from camopt.study.extremes.extremes import LOCATING, STEP_METHODS
from experiments.support.problems import PROBLEMS, Problem, position
from experiments.support.record import RESULTS, run_script, write_result

ANGLE = np.linspace(-np.pi, np.pi, 361)
DIVISORS = {"small": (5, 1), "full": (10, 5, 2, 1)}
LOCATED_STEPS = {"event": 3600, "dop853": 7200}
"""A locating method's steps are samples; these are the finest."""


def errors(problem: Problem, method: str, divisors: tuple[int, ...], reference: np.ndarray) -> dict:
    """A row: errors [um] at each number of steps, the power of the step, and the processor time of the finest."""
    setting, finest = problem.setting(), LOCATED_STEPS.get(method, problem.steps)
    found: list[float] = []
    seconds = np.nan
    for divisor in divisors:
        revolve = (STEP_METHODS | LOCATING)[method](setting.train, setting.lift, setting.cam_speed, finest // divisor)
        revolve(setting.start)  # tables and compilation
        begin = time.process_time()
        motion = revolve(setting.start)
        seconds = time.process_time() - begin
        found.append(float(np.abs(position(setting, motion, ANGLE) - reference).max() / UM))
    known = np.isfinite(found)  # not where the step is past the stability limit
    power = np.polyfit(np.log(np.array(divisors)[known]), np.log(np.array(found)[known]), 1)[0]
    return {
        "problem": problem.name,
        "method": method,
        "steps": [finest // d for d in divisors],
        "error_um": found,
        "power_of_step": None if method in LOCATING else float(power),
        "tolerance_um": problem.tolerance.get(method, np.nan) / UM,
        "processor_ms": 1e3 * seconds,
    }


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `fixed_problems.json`."""
    rows = []
    for problem in PROBLEMS[: 2 if size == "small" else None]:
        reference = problem.reference(ANGLE)
        for method in (*STEP_METHODS, *(LOCATING if size == "full" else ("event",))):
            rows.append(errors(problem, method, DIVISORS[size], reference))
            print(rows[-1])
    return write_result("fixed_problems", size, {"rows": rows}, {"error": draw(rows)}, folder)


@styled
def draw(rows: list[dict]) -> Figure:
    """Error against the number of steps, a panel for each problem and a line for each method."""
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    figure = new_figure(10.0, 3.4)
    panels = figure.subplots(1, len(problems), sharey=True)
    for axes, problem in zip(panels, problems, strict=True):
        for row in (row for row in rows if row["problem"] == problem):
            axes.loglog(row["steps"], row["error_um"], "o-", markersize=3, label=row["method"])
        axes.set(title=problem, xlabel="steps in a revolution")
    panels[0].set_ylabel("error [um]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=7)
    return figure


if __name__ == "__main__":
    run_script(main, __doc__)
