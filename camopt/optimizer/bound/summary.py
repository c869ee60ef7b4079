"""What a scene allows, before any search: a certified bound, the kinematic and the no-jump optimum, and its bound.

The area of every cam that keeps the force margins, under the linear model, margins and angles, is again bounded by weak
duality: to the area and the multiplier terms of `camopt.optimizer.bound.certificate`, every force row is added times a
multiplier >= 0. Each force is a linear functional of the jerk (or acceleration), whose kernel follows from the adjoint
of the periodic motion, by one backward sweep for all rows of a speed. It is exact at the edges of the sweep; between
them it is a cubic Hermite interpolant, whose error is of fourth order in a step short compared with every period.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly
from threadpoolctl import threadpool_limits

from camopt.cam.families.free import FreeCam
from camopt.cam.linear_limits import radii_held_near
from camopt.optimizer.bound.certificate import (
    INTERVALS,
    Certificate,
    Terms,
    area_ratio_bound,
    control_is_limited,
    piecewise_sum,
)
from camopt.optimizer.bound.fine_program import DiscretisedControlProblem, duration_grid, left_out
from camopt.optimizer.program.force_rows import PEAK, SEAT, SpeedRows, speed_rows
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import NoJumpProgram, no_jump_program
from camopt.optimizer.program.periodic import exact_steps, sample_cam, velocity_scale
from camopt.optimizer.program.phases import HELD_N, usual_margin
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import converge_tangents
from camopt.scene.errors import InputError
from camopt.scene.rest import is_linear
from camopt.scene.schema import Scene
from camopt.scene.train import Train, build_train
from camopt.scene.units import DEG, MM

STEP = 0.05 * DEG
"""Step of the backward sweep [rad]."""
SUPPLYING_KNOT_DEG = 1.0
"""Knot interval of the free cam whose duals supply the force multipliers."""


@dataclass(frozen=True)
class NoJumpCertificate:
    """Multipliers of the limits (`kinematic`) and of every force row of `program` (r), and the bound that follows from
    them. It bounds the area ratio of every cam, spline or not, whose forces keep `margins` (3, speeds) [N] on these
    rows, under the linear model with its switching angles."""

    program: NoJumpProgram
    margins: np.ndarray
    kinematic: Certificate
    force: np.ndarray

    @cached_property
    def bound(self) -> float:
        """Upper bound on the area ratio, from the stored multipliers alone; raises ValueError if one is negative."""
        if not np.all(self.force >= 0):
            raise ValueError("the force multipliers of a certificate must be >= 0")
        return self.kinematic.evaluate(force_terms(self.program, self.margins, self.force))


def no_jump_bound(
    program: NoJumpProgram, margins: ArrayLike, knot_deg: float = SUPPLYING_KNOT_DEG
) -> NoJumpCertificate | None:
    """The certificate of a program's speeds and angles; None if the design does not limit the control.

    The multipliers of the forces are the duals of the program for a free cam with knots every `knot_deg`; those of the
    limits then come from the discretised continuous problem. Raises NoCamHoldsContact if no such cam keeps the margins.
    """
    design = program.design
    if not control_is_limited(design):
        return None
    angles = [block.angles for block in program.blocks]
    searched = ("waves_max", *radii_held_near(design))  # held in one of several ways, which no bound may use
    capped = design.model_copy(update={"reach_max_lift": False} | dict.fromkeys(searched))  # a cap gives a bound, too
    cam = program_cam(capped, knot_deg)
    fine = replace(program, design=capped, cam=cam).relocated(angles)
    solution = fine.solve(margins)
    full = design.max_lift_mm * MM * design.duration_deg * DEG
    force = solution.optimum.duals[len(fine.limits.bound) :] * full
    _, kernel = force_terms(fine, solution.margins, force)
    grid = duration_grid(design, INTERVALS)
    worth = np.diff(kernel.antiderivative()(grid))
    kinematic = Certificate(design, grid, *DiscretisedControlProblem(design, grid).multipliers(worth))
    return NoJumpCertificate(fine, solution.margins, kinematic, force)


def force_terms(program: NoJumpProgram, margins: np.ndarray, multipliers: np.ndarray) -> Terms:
    """The sum of multiplier times (force - margin) over all force rows, as a functional of the control."""
    line = replace(program.cam, x_p=np.zeros_like(program.cam.x_p), Z=np.zeros((len(program.cam.x_p), 0)))
    constant, kernel = 0.0, None
    for i, block in enumerate(program.blocks):
        signed = np.where(block.kind == PEAK, -1.0, 1.0) * multipliers[program.speed == i]
        samples = sample_cam(line, block.angles)
        without = speed_rows(program.train, program.design, samples, block.cam_speed, block.angles)
        peak = program.design.contact_force_max_N or 0.0
        level = np.where(block.kind == PEAK, peak, margins[np.minimum(block.kind, SEAT), i])
        constant += float(signed @ (without.offset - level))
        of_speed = _kernel(program, line, block, signed)
        kernel = of_speed if kernel is None else piecewise_sum(kernel, of_speed)
    assert kernel is not None, "a program has at least one speed"
    return constant, kernel


def _kernel(program: NoJumpProgram, line: FreeCam, block: SpeedRows, signed: np.ndarray) -> PPoly:
    """Kernel over the duration: what a unit of control at s adds to the sum of `signed` times a speed's forces."""
    train, speed = program.train, block.cam_speed
    edges = sample_cam(line, block.angles, STEP).edges
    steps = exact_steps(train, edges, speed, block.angles)
    n2 = 2 * len(train.mass)
    size = n2 + 3  # state, lift, velocity, acceleration
    moves, generators = steps.whole[:, :size, :size], steps.generator[:, :size, :size]
    readings = _readings(train, block, signed, edges)
    state = _periodic_adjoint(moves[:, :n2, :n2], steps.kind, readings[:, :n2])
    begin, end = (int(np.argmin(np.abs(edges - b))) for b in line.breaks[[0, -1]])
    control = n2 + (
        2 if program.design.jerk_max_mm_per_deg3 is not None else 1
    )  # the derivative that the control adds to
    eta = np.concatenate([state[end], np.zeros(3)])
    value, slope = np.empty((2, end - begin)), np.empty((2, end - begin))  # at the left and right end of every step
    for j in range(end - 1, begin - 1, -1):
        feed = generators[steps.kind[j], :, control]
        value[1, j - begin], slope[1, j - begin] = eta[control], -feed @ eta
        eta = moves[steps.kind[j]].T @ eta
        value[0, j - begin], slope[0, j - begin] = eta[control], -feed @ eta
        eta += readings[j]
    width = np.diff(edges[begin : end + 1])
    rise = (value[1] - value[0]) / width
    bend = (3 * rise - 2 * slope[0] - slope[1]) / width
    twist = (slope[0] + slope[1] - 2 * rise) / width**2
    return PPoly(np.stack([twist, bend, slope[0], value[0]]), edges[begin : end + 1])


def _readings(train: Train, block: SpeedRows, signed: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Coefficients, at every edge, of state, lift, velocity and acceleration in the sum of `signed` times forces."""
    n2, d, omega = 2 * len(train.mass), train.incidence, velocity_scale(train)
    readings = np.zeros((len(edges), n2 + 3))
    at = np.searchsorted(edges, block.angle - 1e-9)
    assert np.max(np.abs(edges[at] - block.angle)) < 1e-9, "every force row lies on an edge of the finer sweep"
    for e in np.unique(block.element):
        k, c, drive = train.stiffness[e], train.damping[e], float(train.cam_driven[e])
        lift = drive * np.array([k, c * block.cam_speed, 0.0])
        reading = np.concatenate([k * d[e], c * omega * d[e], lift])
        rows = np.flatnonzero((block.element == e) & (signed != 0))
        np.add.at(readings, at[rows], signed[rows, None] * reading)
    return readings


def _periodic_adjoint(moves: np.ndarray, kind: np.ndarray, readings: np.ndarray) -> np.ndarray:
    """Adjoint state at every edge, its own reading included, of the motion that is periodic over the edges."""
    readings = readings.copy()
    readings[0] += readings[-1]  # one state, read at both ends of the revolution
    readings[-1] = 0.0
    n2 = readings.shape[1]
    swept = np.zeros((len(readings), n2, n2 + 1))  # homogeneous solutions, and the one from zero
    swept[-1, :, :n2] = np.eye(n2)
    for j in range(len(kind) - 1, -1, -1):
        np.matmul(moves[kind[j]].T, swept[j + 1], out=swept[j])
        swept[j, :, n2] += readings[j]
    last = np.linalg.solve(np.eye(n2) - swept[0, :, :n2], swept[0, :, n2])
    return swept[:, :, :n2] @ last + swept[:, :, n2]


KNOT_DEG = 2.0
LEAST_WORTH = 5e-5
"""Changes of area below this [per cent] would be shown as zero."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small: threads would only wait for each other
def area_bound(scene: Scene, knot_deg: float = KNOT_DEG, margin_N: float | None = None) -> dict:
    """Area ratios that a scene allows, as `bound --json` prints them.

    - `area_ratio_bound`: no cam under the design's limits has more, spline or not.
    - `bound_leaves_out`: keys of limits that the bound does not use; it holds with them too, but is less tight.
    - `area_ratio_feasible`: the largest of a free cam under the design's limits.
    - `area_ratio_no_jump`: the largest of a free cam whose contacts keep `margins_N`, and its seat `seat_margin_N`, at
      the listed speeds under the linear model; null if there is none.
    - `area_ratio_no_jump_bound`: no cam, spline or not, has more under that linear model, its margins and its switching
      angles. If the first bound is smaller, it is given here, because both hold.
    - `no_jump_says`: the reason why one of these two is missing; null if both are there.
    - `speeds_rpm` (k), `margins_N` and `seat_margin_N`: the speeds and the forces of these two. The forces are
      `margin_N`, by default the design's contact_force_min_N or, if it has none, `usual_margin`. The seat is not
      covered by that limit of the design and keeps `usual_margin` at most.
    - `worth_percent`: the gain of area, in per cent, for 1 % more of each limit.

    Raises InputError for contradictory limits.
    """
    design, operation = scene.required_design, scene.required_operation
    cam = program_cam(design, knot_deg)
    feasible = kinematic_optimum(design, cam)
    speeds = [scene.cam_speed(s) for s in operation.speeds_rpm]
    bound = float(area_ratio_bound(design).bound)
    no_jump = no_jump_bounded = says = None

    def margins(usual: float) -> tuple[float, float]:
        force = (design.contact_force_min_N or usual) if margin_N is None else margin_N
        return force, min(force, usual) if margin_N is None else margin_N

    force, seat = margins(HELD_N)
    try:
        train = build_train(scene)
        force, seat = margins(usual_margin(train))
        program = converge_tangents(no_jump_program(train, design, cam, speeds), force)
        no_jump = program.solve((force, force, seat)).area_ratio
        if is_linear(train):
            certificate = no_jump_bound(program, (force, force, seat))
            no_jump_bounded = certificate and min(bound, float(certificate.bound))
        else:
            bent = [f"{e.name!r} ({e.form})" for e in scene.element if e.form != "linear"]
            what = ", ".join(bent) or "the force on a mass"
            says = f"no bound for closed contacts: it exists only for linear trains, and this one has {what}"
    except InputError as error:  # a refusal by the train does not concern the bounds on the shape
        says = str(error)
    return {
        "area_ratio_bound": bound,
        "bound_leaves_out": left_out(design),
        "area_ratio_feasible": feasible.area_ratio,
        "area_ratio_no_jump": no_jump,
        "area_ratio_no_jump_bound": no_jump_bounded,
        "no_jump_says": says,
        "speeds_rpm": list(operation.speeds_rpm),
        "margins_N": force,
        "seat_margin_N": seat,
        "worth_percent": feasible.sensitivities,
    }


def bound_lines(content: dict) -> list[str]:
    """The content of `bound --json` in sentences and a table, with units and only meaningful digits."""
    lines = [
        "area ratio: the lift's integral over the duration, by max_lift_mm times duration_deg",
        _row("certified upper bound", content["area_ratio_bound"]),
        _row("a cam within the limits on the shape has", content["area_ratio_feasible"]),
    ]
    if ignored := ", ".join(content["bound_leaves_out"]):
        lines.append(f"  the bound ignores {ignored}, so that the true maximum may be lower")
    speeds = ", ".join(f"{speed:g}" for speed in content["speeds_rpm"])
    force, seat = content["margins_N"], content["seat_margin_N"]
    apart = "" if seat == force else f", and the seat by {seat:g} N,"
    lines.append(f"with contacts closed by {force:g} N or more{apart} at {speeds} r/min, by the linear model:")
    if content["area_ratio_no_jump_bound"] is not None:
        lines.append(_row("upper bound for every cam", content["area_ratio_no_jump_bound"]))
    if content["area_ratio_no_jump"] is not None:
        lines.append(_row("a cam has", content["area_ratio_no_jump"]))
    if content["no_jump_says"]:
        lines.append(f"  {content['no_jump_says']}")
    worth = {name: value for name, value in content["worth_percent"].items() if abs(value) >= LEAST_WORTH}
    if worth:
        lines.append("1 % more of a limit on the shape increases the area by, in per cent:")
        width = max(map(len, worth))
        lines += [f"  {name:<{width}} {value:8.4f} %" for name, value in worth.items()]
    free = [name for name in content["worth_percent"] if name not in worth]
    return lines + [f"  no effect: {', '.join(free)}"] * bool(free)


def _row(label: str, ratio: float) -> str:
    return f"  {label:<42} {ratio:.5f}"
