"""One motion from rest, by any of the methods, on a regular grid of cam angles."""

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from camopt.cam.lift import Lift, lift_with
from camopt.measure.settling import within_bound
from camopt.scene import InputError, Response, Scene, Train, build_train, state_at_rest
from camopt.scene.response import record_of
from camopt.scene.smoothing import NAMES, Smoothing, smoothing
from camopt.scene.units import DEG
from camopt.scene.vibration import highest_rate
from camopt.study.simulate.dataset import motion_dataset, recorded_metrics, resampled
from camopt.verifier.methods import verdict_methods
from camopt.verifier.verdict import chords_at, method_named

if TYPE_CHECKING:
    import xarray as xr  # loads pandas, which the main job does not need

    from camopt.study.simulate.accuracy_control import Delivered, Run

SMOOTH = "camopt.smooth.simulate"
"""The smooth path's module, which imports JAX; every other method is one of a verdict's."""
DIFFERENTIABLE = {"smooth": SMOOTH, "event": "camopt.smooth.exact_rule"}
"""Modules with a `differentiable_motion`, by the method of `simulate(parameters=...)`."""
LARGEST_PHASE = 0.3
"""Largest step times highest rate of the train [rad]: MOTORI 2004's rule for explicit steps (0.31), also for plots."""
MOST_VALUES = 4e7
"""Largest number of values of a record (320 MB, and three times that while it is computed)."""
FEWEST_STEPS = 720
"""Least steps per revolution where an accuracy chooses them: the cam of a slow train must be resolved, too."""
TOLERANCE_OF_WIDTH = 5e-3
"""The smooth path's error per step relative to its layer width, where an accuracy or a width chooses them."""
LEAST_WIDTH = 2.5e-10
"""Least layer width [m] that an accuracy may choose."""
FEWEST_CHORDS, MOST_CHORDS = 16, 128
"""Smallest and largest number of chords of a curved law in event-exact, where an accuracy chooses them: twice as many
have a quarter of the error and cost about four times as much."""


def simulate(
    scene: Scene,
    cam: Lift,
    speed_rpm: float,
    method: str = "event",
    *,
    revolutions: int = 2,
    step_deg: float = 0.1,
    parameters: Mapping[str, Any] | None = None,
    accuracy: str | float | None = None,
    progress: bool = False,
    width_um: float | None = None,
    tie: float | None = None,
    steps_per_revolution: int | None = None,
) -> "xr.Dataset":
    """Motion of the valve train from rest at -180 degrees, `revolutions` of the cam at a crankshaft speed [r/min].

    The result is a dataset over `sample`, every `step_deg` [cam degrees, which must divide 360], with coordinates
    revolution (from 1), cam_angle_deg (-180 to 180), time_s, and variables lift_mm, position_mm and velocity_m_per_s
    (sample, mass), force_N (sample, element). It also holds the declared metrics (`camopt.scene.quantities`) over
    `measured`, all revolutions but the last, which only completes the window of the previous one.

    `method` is "event", "smooth" or one of `camopt.verifier.methods.INDEPENDENT`. With an `accuracy`, a name or
    micrometres of the valve's position, its dial is refined until the motion converges or the budget is spent. The
    attributes then state the estimated error (`camopt.study.simulate.accuracy_control`), and with `progress` a bar
    shows the budget. Without an accuracy they state it for event-exact where chords replace curved laws. `parameters`
    (see `motion_parameters`) replaces numbers of scene and cam by arrays that JAX may trace; `camopt.study.simulate`
    describes steps and gradients.

    By "smooth" a contact begins to push across `width_um` [um], by default 0.002, with steps adapted to this width. If
    a share `tie` or `steps_per_revolution` is given, the motion is that of `linearised`, with 1 um by default.

    Raises InputError for unusable arguments, a motion that the method refuses, or a record that would be too large.
    """
    train, cam_speed, known_speed, steps, finer = _checked_settings(scene, speed_rpm, method, revolutions, step_deg)
    how = _smoothing(method, width_um, tie, steps_per_revolution, parameters, accuracy)
    if parameters is not None:
        _check_parameters(scene, cam, method, parameters)
        rule = import_module(DIFFERENTIABLE[method]).differentiable_motion
        layer = {} if width_um is None else {"eps": how.width}
        shown, metrics = rule(train, cam, parameters, cam_speed, revolutions, steps, known_speed, **layer)
        return motion_dataset(scene, cam, speed_rpm, method, shown, metrics)
    attributes: dict[str, Any] = {}
    if accuracy is not None:
        motion = delivered(train, cam, cam_speed, method, revolutions, accuracy, progress=progress)
        response, attributes = motion.response, motion.attributes()
    elif tie is not None or steps_per_revolution is not None:
        module = import_module("camopt.study.tied_motions")
        response = module.tied_motion(train, cam, cam_speed, revolutions, how)
    elif width_um is not None:
        response = dialled(train, cam, cam_speed, method, revolutions)(how.width)
    else:
        response = _motion(train, cam, cam_speed, method, revolutions, steps * finer)
        if method == "event" and not train.straight:
            attributes = _chord_error(train, cam, cam_speed, response, steps * finer)
    shown, metrics = resampled(response, steps * revolutions), recorded_metrics(response, cam)
    return motion_dataset(scene, cam, speed_rpm, method, shown, metrics).assign_attrs(attributes)


def _smoothing(method: str, width_um, tie, steps, parameters, accuracy) -> Smoothing:
    """The requested smoothing; raises InputError where it does not apply to the other arguments."""
    how = smoothing("simulate", width_um, tie, steps)
    named = [name for name, value in zip(NAMES, (width_um, tie, steps), strict=True) if value is not None]
    if named and (method != "smooth" or accuracy is not None):
        raise InputError(f"simulate: {named[0]} with method {method!r}: take method='smooth', without an accuracy")
    if parameters is not None and named not in ([], ["width_um"]):
        raise InputError(f"simulate: {named[-1]} with parameters: take camopt.linearised or camopt.objective")
    return how


def recorded(scene: Scene, cam: Lift, speed_rpm: float, method: str, *, revolutions: int) -> Response:
    """The motion of `simulate` with its default settings, as plain arrays; raises InputError as `simulate` does."""
    train, cam_speed, _, steps, finer = _checked_settings(scene, speed_rpm, method, revolutions, 0.1)
    return resampled(_motion(train, cam, cam_speed, method, revolutions, steps * finer), steps * revolutions)


def _checked_settings(scene: Scene, speed_rpm, method, revolutions, step_deg) -> tuple[Train, Any, float, int, int]:
    """Train, cam speed [rad/s], a known cam speed (the lowest that the scene names where JAX traces the speed), steps
    of the result per revolution, and steps of the method in each of these; numbers and choices are checked."""
    methods = *verdict_methods(), "smooth"
    if method not in methods:
        raise InputError(f"simulate: method {method!r}: expected one of {', '.join(methods)}")
    try:
        number = float(speed_rpm)
    except TypeError:  # traced by JAX
        number = None
    if number is not None and not (np.isfinite(number) and number > 0):
        raise InputError(f"simulate: speed {speed_rpm}: a crankshaft speed above 0 r/min is needed")
    if int(revolutions) != revolutions or not 1 <= revolutions <= 1000:
        raise InputError(f"simulate: revolutions {revolutions}: an integer from 1 to 1000 is needed")
    steps = round(360.0 / step_deg) if step_deg > 0 else 0
    if not (1 <= steps <= 360_000) or abs(steps * step_deg - 360.0) > 1e-9 * steps:
        raise InputError(f"simulate: step {step_deg} deg: a step that divides 360 deg, 0.001 or more, is needed")
    if scene.operation is None or scene.seat is None:
        raise InputError(f"scene {scene.name}: simulate needs valve, seat and [operation]")
    if number is None:
        number = min(*scene.operation.speeds_rpm, *scene.operation.band_rpm)
    train, known_speed = build_train(scene), scene.cam_speed(number)
    finer = max(1, int(np.ceil(highest_rate(train) * step_deg * DEG / known_speed / LARGEST_PHASE)))
    rows, each = steps * finer * revolutions, 2 + 2 * len(train.mass) + len(train.a)
    if rows * each > MOST_VALUES:
        raise InputError(
            f"simulate at {speed_rpm} r/min: the train's highest mode of {highest_rate(train) / 2e3 / np.pi:.3g} kHz "
            f"oscillates so fast that {rows / 1e6:.3g} million steps of {each} numbers would have to "
            f"be kept ({8e-9 * rows * each:.2g} GB), and {8e-9 * MOST_VALUES:.2g} GB are allowed: raise the speed, ask "
            f"for fewer revolutions, or take a smaller model (camopt reduce)"
        )
    return train, scene.cam_speed(speed_rpm), known_speed, steps, finer


def delivered(
    train: Train, cam: Lift, cam_speed: float, method: str, revolutions: int, accuracy: str | float, *, progress=False
) -> "Delivered":
    """The motion from rest at an accuracy; see `camopt.study.simulate.accuracy_control`."""
    from camopt.study.simulate.accuracy_control import CHORDS_DIAL, MOST_VALUES, deliver

    run, least, dial = dialled(train, cam, cam_speed, method, revolutions), LEAST_WIDTH, method
    if method != "smooth":
        most = MOST_VALUES / revolutions / (2 + 2 * len(train.mass) + len(train.a))
        least = 2 * np.pi * highest_rate(train) / cam_speed / most
    if method == "event" and not train.straight:
        least, dial = max(least, LARGEST_PHASE * (FEWEST_CHORDS / MOST_CHORDS) ** 2), CHORDS_DIAL
    return deliver(run, dial, accuracy, revolutions, least, progress=progress)


def dialled(train: Train, cam: Lift, cam_speed: float, method: str, revolutions: int) -> "Run":
    """The motion from rest as a function of the method's dial: step times highest rate [rad], or layer width [m].

    Event-exact has chords in place of curved laws. Their number is proportional to the inverse square root of the dial,
    so that their error is proportional to the dial; the number of steps, which are only samples there, grows likewise.
    """
    rate, chorded = highest_rate(train), method == "event" and not train.straight

    def run(setting: float) -> Response:
        if method == "smooth":
            layer = {"eps": setting, "tolerance": setting * TOLERANCE_OF_WIDTH}
            return _motion(train, cam, cam_speed, method, revolutions, 0, 0, **layer)
        finer = (LARGEST_PHASE / setting) ** 0.5
        phase, chords = (LARGEST_PHASE / finer, round(FEWEST_CHORDS * finer)) if chorded else (setting, 0)
        steps = max(FEWEST_STEPS, int(np.ceil(2 * np.pi * rate / cam_speed / phase)))
        return _motion(train, cam, cam_speed, method, revolutions, steps, chords)

    return run


def _chord_error(train: Train, cam: Lift, cam_speed: float, response: Response, steps: int) -> dict:
    """The attributes on the error of chords in an event-exact motion with this number of steps: the error is estimated,
    as with an accuracy, from motions with the smaller numbers of chords of the coarser settings."""
    from camopt.study.simulate.accuracy_control import CHORDS_DIAL, ESTIMATES, error_text, estimate_um, valve_position

    chords, revolutions = min(MOST_CHORDS, chords_at(train, cam_speed, steps)), response.revolutions
    fewer = [round(chords * 0.5 ** (k / 2)) for k in range(ESTIMATES[CHORDS_DIAL][0], 0, -1)]
    coarser = [_motion(train, cam, cam_speed, "event", revolutions, steps, count) for count in fewer]
    answers = [valve_position(motion, revolutions) for motion in (*coarser, response)]
    error, attributes = error_text(estimate_um(answers, CHORDS_DIAL, revolutions))
    return {"accuracy_statement": f"{error}, from {chords} chords in place of curved laws", **attributes}


def motion_parameters(scene: Scene, cam: Lift) -> dict[str, np.ndarray]:
    """The numbers by which `simulate(parameters=...)` may be differentiated, in SI units, with the scene's values.

    By mass (n): mass [kg], mass_damping [N s/m], mass_force [N]; by element (e): stiffness [N/m, of a hertz contact
    N/m^exponent], damping [N s/m], preload [N], gap [m]. Where a train has nonlinear laws, also by element: the table
    (q, 2) of compressions [m] and forces [N] or stiffnesses [N/m], leak [N s/m] and travel [m] of oil, and slip [N] of
    friction (`camopt.scene.laws.Laws`). Of the cam: lift (p, q) [m/rad^k], the coefficients of its pieces, their
    borders (p + 1) [rad], and half_duration [rad], within which contacts are judged. Any subset may be given to
    `simulate`. This function turns on JAX's 64-bit floats. The pieces of a free cam are linear in z
    (`FreeCam.piece_basis`). A family's parameters also move the borders: `DifferentiableCam.motion_parameters` gives
    all three, and lift coefficients alone are refused where they do not join at the given borders.
    """
    import_module("camopt.smooth")  # turns on JAX's 64-bit floats before anything is traced
    numbers = {name: number.copy() for name, number in build_train(scene).parameters.items()}
    pieces = {"lift": cam.coefficients.copy(), "borders": cam.borders.copy()}
    return {**numbers, **pieces, "half_duration": np.asarray(cam.half_duration)}


def _check_parameters(scene: Scene, cam: Lift, method: str, parameters: Mapping[str, Any]) -> None:
    if method not in DIFFERENTIABLE:
        raise InputError(f"simulate: method {method!r} with parameters: needs one of {', '.join(DIFFERENTIABLE)}")
    jax = import_module("jax")
    traced = any(isinstance(value, jax.core.Tracer) for value in parameters.values())
    if traced and not jax.config.jax_enable_x64:
        raise InputError("simulate: traced in 32-bit floats: call motion_parameters or import camopt.smooth before")
    numbers = motion_parameters(scene, cam)
    for name, value in parameters.items():
        if name not in numbers:
            raise InputError(f"simulate: parameter {name!r}: expected one of {', '.join(numbers)}")
        if np.shape(value) != numbers[name].shape:
            raise InputError(
                f"simulate: parameter {name!r} has shape {np.shape(value)}: {numbers[name].shape} is needed, "
                f"as motion_parameters(scene, cam) gives it"
            )
    if not any(isinstance(parameters.get(name), jax.core.Tracer) for name in ("lift", "borders", "half_duration")):
        lift_with(cam, parameters)


def _motion(
    train: Train, cam: Lift, cam_speed: float, method: str, revolutions: int, steps: int, chords: int = 0, **layer
) -> Response:
    """The motion from rest with `steps` per revolution, or of "smooth" with its own steps and this `layer`. Event-exact
    replaces each curved law by `chords`, by default as many as a verdict with these steps has, at most MOST_CHORDS."""
    state = state_at_rest(train)
    if method == "event" and not train.straight:
        chords = chords or min(MOST_CHORDS, chords_at(train, cam_speed, steps))
        train = import_module("camopt.exact.affine.lines").with_chords(train, chords)
    if method == "smooth":  # equal steps would miss the contact layers
        revolve = import_module(SMOOTH).prepare(train, cam, cam_speed, **layer)
    else:
        revolve = method_named(method)(train, cam, cam_speed, steps)
    return record_of(lambda begin: within_bound(revolve(begin)), state, revolutions)
