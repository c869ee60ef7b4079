"""How accurate is every method on the fixed problems of the tests?

The motion of one mass over one revolution is compared with a formula where there is one, and otherwise with event-exact
in smaller steps, which the tests compare with DOP853 and with formulas. `PROBLEMS` has the tolerance that each method
must meet on each problem. The error falls with a power of the step, which is fitted over numbers of steps from a tenth
of the table's number up to that number.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.exact import prepare as event_exact
from camopt.scene import Response, Train, build_train, load_scene, parse_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.units import UM
from camopt.study.extremes.cases import fast_mode
from camopt.study.extremes.extremes import LOCATING, STEP_METHODS
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, printed, run_script, write_result

REFERENCE_STEPS = 7200


@dataclass(frozen=True)
class Setting:
    """A train with a cam at one speed, with its initial state (2n); `mass` is the index of the compared mass."""

    train: Train
    lift: Lift
    cam_speed: float  # rad/s
    start: np.ndarray
    mass: int


@dataclass(frozen=True)
class Problem:
    """`tolerance` [m]: largest error of the position by method at FINE steps per revolution; `motion`: position [m] at
    times [s] from the start, where a formula gives it."""

    name: str
    setting: Callable[[], Setting]
    tolerance: dict[str, float]
    motion: Callable[[np.ndarray], np.ndarray] | None = None

    def reference(self, angle: np.ndarray) -> np.ndarray:
        """Position [m] at cam angles (k) [rad], which must be among the REFERENCE_STEPS samples of event-exact."""
        s = self.setting()
        if self.motion is not None:
            return self.motion((angle + np.pi) / s.cam_speed)
        return position(s, event_exact(s.train, s.lift, s.cam_speed, REFERENCE_STEPS)(s.start), angle)


def position(s: Setting, response: Response, angle: np.ndarray) -> np.ndarray:
    """Position of the compared mass [m] at angles (k) that are among the samples of a response."""
    i = np.searchsorted(response.angle, angle - 1e-9).clip(max=len(response.angle) - 1)
    assert np.abs(response.angle[i] - angle).max() < 1e-9, "the angles must be samples"
    return response.x[i, s.mass]


BALL = """
format = 1
name = "ball"
valve = "ball"
seat = "floor"
[[mass]]
name = "ball"
mass_kg = 1.0
force_N = -10.0
[[element]]
name = "cam"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = 1.0e6
gap_mm = 500.0
cam_driven = true
[[element]]
name = "floor"
kind = "contact"
between = ["ground", "ball"]
stiffness_N_per_m = 4.0e4
"""
HEIGHT, GRAVITY, FLOOR = 0.2, 10.0, 4e4


@cache
def ball() -> Setting:
    """1 kg that falls from HEIGHT above an undamped seat, with a cam without lift; a revolution lasts 1 s."""
    flat = Lift(np.array([-np.pi, np.pi]), np.zeros((1, 7)), np.pi / 2)
    return Setting(build_train(parse_scene(BALL, "ball")), flat, 2 * np.pi, np.array([HEIGHT, 0.0]), 0)


def bouncing(time: np.ndarray) -> np.ndarray:
    """Position [m] of the ball at times [s]: parabolas, and sine arcs about the static deflection during contact."""
    fall, omega, sag = np.sqrt(2 * HEIGHT / GRAVITY), np.sqrt(FLOOR), GRAVITY / FLOOR
    speed = GRAVITY * fall
    contact = 2 * (np.pi - np.arctan(speed / (omega * sag))) / omega
    t = np.mod(time + fall, 2 * fall + contact)  # from the moment it leaves the floor
    flying = speed * t - GRAVITY * t**2 / 2
    c = omega * (t - 2 * fall)
    return np.where(t < 2 * fall, flying, sag * (np.cos(c) - 1) - speed / omega * np.sin(c))


@cache
def valve(name: str, speed_rpm: float, frequency_Hz: float | None = None) -> Setting:
    """The valve of a built-in scene with its plain Polydyne from rest; `frequency_Hz` sets the highest frequency."""
    scene = load_scene(name)
    changed = scene if frequency_Hz is None else fast_mode(scene, frequency_Hz)
    train = build_train(changed)
    return Setting(train, polydyne(scene), scene.cam_speed(speed_rpm), state_at_rest(train), train.valve)


def micrometres(**by_method: float) -> dict[str, float]:
    """Tolerances [m] from values in micrometres; keyword names have underscores in place of the methods' hyphens."""
    return {name.replace("_", "-"): value * UM for name, value in by_method.items()}


FINE = 36_000
PROBLEMS = (  # three times the measured error, except for the locating method, whose tolerance is round-off
    Problem(
        "ball on its seat",
        ball,
        micrometres(rkg=3, tmm=27, tmm_exponential=27, houbolt=11, houbolt_explicit=9, event=1e-6),
        bouncing,
    ),
    Problem(
        "motori-1",
        lambda: valve("motori-1", 6000),
        micrometres(rkg=1.0, tmm=3.5, tmm_exponential=3.5, houbolt=2.6, houbolt_explicit=2.0, event=1e-3),
    ),
    Problem(
        "pushrod",
        lambda: valve("pushrod-5mass", 5000),
        micrometres(rkg=0.09, tmm=0.13, tmm_exponential=0.13, houbolt=0.02, houbolt_explicit=0.02, event=1e-3),
    ),
    Problem(
        "kodama, nominal",
        lambda: valve("kodama", 5000),
        micrometres(rkg=0.005, tmm=0.03, tmm_exponential=0.03, houbolt=0.02, houbolt_explicit=0.015, event=1e-3),
    ),
    Problem(
        "kodama, 72 kHz",
        lambda: valve("kodama", 7000, 72e3),
        micrometres(rkg=1.4, tmm=12, tmm_exponential=12, houbolt=8, houbolt_explicit=2.2, event=1e-3),
    ),
)

ANGLE = np.linspace(-np.pi, np.pi, 361)
DIVISORS = {"small": (5, 1), "full": (10, 5, 2, 1)}
LOCATED_STEPS = {"event": 3600, "dop853": 7200}
"""Largest numbers of samples of the locating methods, used in place of steps."""


def errors(problem: Problem, method: str, divisors: tuple[int, ...], reference: np.ndarray) -> dict:
    """A row: errors [um] at each number of steps, and the power of the step."""
    setting, finest = problem.setting(), LOCATED_STEPS.get(method, FINE)
    error_um: list[float] = []
    for divisor in divisors:
        revolve = (STEP_METHODS | LOCATING)[method](setting.train, setting.lift, setting.cam_speed, finest // divisor)
        error_um.append(float(np.abs(position(setting, revolve(setting.start), ANGLE) - reference).max() / UM))
    finite = np.isfinite(error_um)  # a step above the stability limit gives no finite error
    power = np.polyfit(np.log(np.array(divisors)[finite]), np.log(np.array(error_um)[finite]), 1)[0]
    return {
        "problem": problem.name,
        "method": method,
        "steps": [finest // d for d in divisors],
        "error_um": error_um,
        "power_of_step": None if method in LOCATING else float(power),
        "tolerance_um": problem.tolerance.get(method, np.nan) / UM,
    }


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `fixed_problems.json`."""
    rows = []
    for problem in PROBLEMS[: 2 if size == "small" else None]:
        reference = problem.reference(ANGLE)
        for method in (*STEP_METHODS, *(LOCATING if size == "full" else ("event",))):
            rows.append(printed(errors(problem, method, DIVISORS[size], reference)))
    return write_result("fixed_problems", size, {"rows": rows}, {"error": draw(rows)}, folder)


def draw(rows: list[dict]) -> Figure:
    """Error against the number of steps, a panel for each problem and a line for each method."""
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    curves = {p: [(r["method"], r["steps"], r["error_um"]) for r in rows if r["problem"] == p] for p in problems}
    row = [Panel("error [um]" if p == problems[0] else "", curves[p], p) for p in problems]
    log = ("log", "log")
    return panels([row], "steps in a revolution", None, 10.0, 2.5, sharey=True, scale=log, marker="o")


if __name__ == "__main__":
    run_script(main, __doc__)
