"""What a scene allows, before any search: the certified bound, the kinematic optimum, the no-jump optimum."""

from threadpoolctl import threadpool_limits

from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.limit_terms import left_out
from camopt.optimizer.bound.no_jump import no_jump_bound
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import kinematic_optimum, limit_sensitivities
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import converge_tangents
from camopt.scene.errors import InputError
from camopt.scene.rest import is_linear
from camopt.scene.schema import Scene
from camopt.scene.train import build_train

KNOT_DEG = 2.0
MARGIN_N = 20.0
"""Least force on a contact [N] where nothing else is asked for."""
LEAST_WORTH = 5e-5
"""Per cent of area that would show as zero."""


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small: threads would wait for each other
def area_bound(scene: Scene, knot_deg: float = KNOT_DEG, margin_N: float | None = None) -> dict:
    """Area ratios that a scene allows, as `bound --json` prints them.

    - `area_ratio_bound`: no cam under the design's limits has more, spline or not.
    - `bound_leaves_out`: keys of limits that it does not count on, so that it holds with them but is less tight.
    - `area_ratio_feasible`: a free cam has so much.
    - `area_ratio_no_jump`: the largest of a free cam whose contacts keep `margins_N`, and its seat `seat_margin_N`, at
      the listed speeds under the linear model, null where none does.
    - `area_ratio_no_jump_bound`: what no cam, spline or not, exceeds under that linear model, its margins and its
      switching angles. Where the first bound is smaller it stands here, as both hold.
    - `no_jump_says`: why one of these two is not there, null where both are.
    - `speeds_rpm` (k), `margins_N` and `seat_margin_N`: the speeds and the forces of these two. The forces are
      `margin_N`, by default the design's contact_force_min_N, and MARGIN_N where it has none; the seat, which that
      limit leaves out, keeps MARGIN_N at most.
    - `worth_percent`: what 1 % more of each limit buys.

    Raises InputError for contradictory limits.
    """
    design, operation = scene.required_design, scene.required_operation
    cam = program_cam(design, knot_deg)
    feasible = kinematic_optimum(design, cam)
    speeds = [scene.cam_speed(s) for s in operation.speeds_rpm]
    bound = float(area_ratio_bound(design).bound)
    no_jump = no_jump_bounded = says = None
    force = (design.contact_force_min_N or MARGIN_N) if margin_N is None else margin_N
    seat = min(force, MARGIN_N) if margin_N is None else margin_N
    try:
        program = converge_tangents(no_jump_program(train := build_train(scene), design, cam, speeds), force)
        no_jump = program.solve(margins := Margins(force, force, seat)).area_ratio
        if is_linear(train):
            certificate = no_jump_bound(program, margins)
            no_jump_bounded = certificate and min(bound, float(certificate.bound))
        else:
            bent = [f"{e.name!r} ({e.form})" for e in scene.element if e.form != "linear"]
            what = ", ".join(bent) or "the force on a mass"
            says = f"no bound for kept contacts: it is known for linear trains, and this one has {what}"
    except InputError as error:  # what the train forbids leaves the bounds on the shape as they are
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
        "worth_percent": limit_sensitivities(feasible),
    }


def bound_lines(content: dict) -> list[str]:
    """The content of `bound --json` in sentences and a table, with units and as many digits as can matter."""
    lines = [
        "area ratio: the lift's integral over the duration, by max_lift_mm times duration_deg",
        _row("no cam has more (certified)", content["area_ratio_bound"]),
        _row("a cam within the limits on the shape has", content["area_ratio_feasible"]),
    ]
    if content["bound_leaves_out"]:
        left_out = ", ".join(content["bound_leaves_out"])
        lines.append(f"  the bound ignores {left_out}, so that the true maximum may be lower")
    speeds = ", ".join(f"{speed:g}" for speed in content["speeds_rpm"])
    force, seat = content["margins_N"], content["seat_margin_N"]
    apart = "" if seat == force else f", and the seat by {seat:g} N,"
    lines.append(f"with contacts closed by {force:g} N or more{apart} at {speeds} r/min, by the linear model:")
    if content["area_ratio_no_jump_bound"] is not None:
        lines.append(_row("no cam has more", content["area_ratio_no_jump_bound"]))
    if content["area_ratio_no_jump"] is not None:
        lines.append(_row("a cam has", content["area_ratio_no_jump"]))
    if content["no_jump_says"]:
        lines.append(f"  {content['no_jump_says']}")
    worth = {name: value for name, value in content["worth_percent"].items() if abs(value) >= LEAST_WORTH}
    if worth:
        lines.append("1 % more of a limit on the shape buys, in per cent of area:")
        width = max(map(len, worth))
        lines += [f"  {name:<{width}} {value:8.4f} %" for name, value in worth.items()]
    free = [name for name in content["worth_percent"] if name not in worth]
    return lines + [f"  nothing: {', '.join(free)}"] * bool(free)


def _row(label: str, ratio: float) -> str:
    return f"  {label:<42} {ratio:.5f}"
