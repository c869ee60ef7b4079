"""What a scene allows, before any search: the certified bound, the kinematic optimum, the no-jump optimum."""

from threadpoolctl import threadpool_limits

from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.bound.limit_terms import left_out
from camopt.optimizer.bound.no_jump import no_jump_bound
from camopt.optimizer.program.force_rows import Margins
from camopt.optimizer.program.kinematic import kinematic_optimum, limit_worth
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.program.relocation import standing
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.scene.standing_in import is_linear
from camopt.scene.train import build_train

KNOT_DEG = 2.0
MARGIN_N = 20.0
"""Least force on a contact [N] where nothing else is asked for."""


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
    design, operation = scene.design, scene.operation
    assert design is not None and operation is not None, "load_scene(..., need=...) guarantees both"
    cam = program_cam(design, knot_deg)
    feasible = kinematic_optimum(design, cam)
    speeds = [scene.cam_speed(s) for s in operation.speeds_rpm]
    bound = float(area_ratio_bound(design).bound)
    no_jump = no_jump_bounded = says = None
    force = (design.contact_force_min_N or MARGIN_N) if margin_N is None else margin_N
    seat = min(force, MARGIN_N) if margin_N is None else margin_N
    try:
        program = standing(no_jump_program(train := build_train(scene), design, cam, speeds), force)
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
        "worth_percent": limit_worth(feasible),
    }
