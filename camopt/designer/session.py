"""The designer's answers to the numbers of an edited scene, independent of page and server.

An answer has parts, which are requested one by one, the quick ones first: "sketch" while the user drags a slider, "cam"
and "band" once it rests, and then the parts that take seconds ("bound", "baselines", "trains"), which another process
computes. Every number is the one that camopt's public functions give for the edited scene.
"""

import json
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from camopt.cam.lift import Lift, lift_table
from camopt.cam.linear_limits import radii_held_near
from camopt.designer.cams import CamFinder, Cancelled, ProgramCam, program_speeds_rpm
from camopt.designer.controls import NO_JUMP, Refused, controls, edited_scene, read_values
from camopt.exact.engine import prepare
from camopt.exact.settled import settled_metrics
from camopt.highs import WATCH
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.settling import decay_per_revolution, settle, settled_from_rest
from camopt.plots.style import DESIGN
from camopt.report.cams import LAW_STEP_DEG
from camopt.report.motion import animated, cam_entry, last_revolution_numbers
from camopt.scene import QUANTITIES, InputError, MotionRefused, Scene, Train, build_train, state_at_rest
from camopt.scene.response import end_state
from camopt.scene.units import DEG, MM
from camopt.storage import plain

STEP_DEG = 1.0
"""Step of the displayed motion [deg]."""
FEW_REVOLUTIONS = 6
"""Largest number of revolutions of a sketch before the one that is shown."""
BAND_SPEEDS, AT_ONCE = 41, 12
"""Number of speeds of the band's curve, and number of them between two checks whether the request is cancelled."""


def motion_at(
    scene: Scene, train: Train, lift: Lift, speed_rpm: float, sketch: bool, start: np.ndarray | None
) -> tuple[dict[str, Any], np.ndarray | None]:
    """One revolution at a crankshaft speed with its metrics, the used share of every limit and the data of the
    animation, or instead a sentence where event-exact refuses the motion; and the state at its end. The motion has
    settled; a `sketch` runs at most FEW_REVOLUTIONS before it, from the state `start` if there is one."""
    cam_speed = scene.cam_speed(speed_rpm)
    try:
        if sketch:
            decay = decay_per_revolution(train, cam_speed)
            begin = start if start is not None and len(start) == train.state_size else state_at_rest(train)
            settled = settle(prepare(train, lift, cam_speed), begin, FEW_REVOLUTIONS, 1, 1, decay=decay)
            settled = replace(settled, periodic=True)  # whether it settles is stated at rest
        else:
            settled = settled_from_rest(prepare, train, lift, cam_speed)
    except (MotionRefused, InputError) as error:
        return {"speed_rpm": speed_rpm, "says": f"The motion is refused: {error}"}, None
    figures, limits = settled.metrics(lift), motion_limits(scene.design)
    metrics = {name: figures.worst(name) for name in QUANTITIES}
    numbers = {"speed_rpm": speed_rpm, **last_revolution_numbers(settled, STEP_DEG)}
    entry = {"name": DESIGN, **cam_entry(DESIGN, lift, scene, STEP_DEG), "motions": [numbers]}
    shown = {
        "speed_rpm": speed_rpm,
        "periodic": settled.periodic,
        "metrics": metrics,
        "used": {key: float(limit.share(np.array(metrics[limit.metric]))) for key, limit in limits.items()},
        "animation": animated(scene, train, [entry], STEP_DEG),
    }
    return shown, end_state(settled.response)


def band_of(scene: Scene, train: Train, lift: Lift, wanted: Callable[[], bool]) -> dict[str, Any]:
    """Every metric at speeds over the scene's band, and for each limit on the motion the largest used share and its
    speed. Raises Cancelled between two groups of speeds once `wanted` returns False."""
    speeds = np.linspace(*scene.required_operation.band_rpm, BAND_SPEEDS)
    batches = []
    for begin in range(0, len(speeds), AT_ONCE):
        if not wanted():
            raise Cancelled
        cam_speeds = [scene.cam_speed(s) for s in speeds[begin : begin + AT_ONCE]]
        batches.append(settled_metrics([train], [lift], cam_speeds))
    curves = {name: np.concatenate([metrics.worst(name)[0, 0] for metrics in batches]) for name in QUANTITIES}
    worst = {}
    for key, limit in motion_limits(scene.design).items():
        used = limit.share(curves[limit.metric])
        at = int(np.argmax(used))
        worst[key] = {"used": used[at], "value": curves[limit.metric][at], "speed_rpm": speeds[at]}
    return {"speeds_rpm": speeds, "curves": curves, "worst": worst}


QUICK = ("sketch", "cam", "band")
"""The parts of an answer that a session computes itself; the others are in `camopt.designer.slow_parts`."""
THREADS = ThreadpoolController()  # created once, because it takes milliseconds to find the libraries' thread pools
REMEMBERED = 4
"""Number of the last cams that are kept."""
DECIMALS = (6, 8, 9, 9)
"""Decimals of the lift and its derivatives in an answer: far more than a chart shows, and half the bytes."""


@dataclass(frozen=True)
class EditedDesign:
    """An edited scene with its train and its cam."""

    scene: Scene
    train: Train
    cam: ProgramCam


class Session:
    """A scene that a user edits: answers values by key, and keeps intermediate results for the next answer."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self.controls = {control.key: control for control in controls(scene)}
        self._cams = CamFinder()
        self._end: np.ndarray | None = None  # the state in which the last motion ended
        self._train: tuple[tuple, Train] | None = None
        self._designs: OrderedDict[str, EditedDesign] = OrderedDict()

    def start(self) -> dict[str, Any]:
        """Data for the start of a page: the scene's name and title, and the controls."""
        title = self.scene.title or self.scene.name
        listed = [asdict(control) for control in self.controls.values()]
        return {"name": self.scene.name, "title": title, "controls": listed}

    def values(self) -> dict[str, Any]:
        """The scene's own values by key."""
        return {key: control.value for key, control in self.controls.items()}

    def answer(
        self, values: Mapping[str, Any], part: str = "cam", wanted: Callable[[], bool] = lambda: True
    ) -> dict[str, Any]:
        """One of the QUICK parts of the answer to values by key, as JSON; a missing value is that of the scene.

        "state" is "ok", "refused" with `faults` (sentences by key), or "no cam" with the sentence `says`. Raises
        Cancelled before the next linear program once `wanted` returns False.
        """
        try:
            speed_rpm = read_values(self.controls, values)["speed_rpm"]
            with cancellable(wanted):
                design = self.design(values, part == "sketch")
        except InputError as error:
            return no_answer(error)
        if part == "band":
            content = band_of(design.scene, design.train, design.cam.lift, wanted)
        else:
            content = self._cam_answer(design, speed_rpm)
        return {"state": "ok", **plain(content)}

    def edited(self, values: Mapping[str, Any]) -> Scene:
        """The scene with the values; raises Refused for invalid values."""
        return edited_scene(self.scene, read_values(self.controls, values))

    def design(self, values: Mapping[str, Any], coarse: bool = False) -> EditedDesign:
        """The edited scene, its train and its cam; raises Refused for invalid values, and InputError where the limits
        contradict each other."""
        read = read_values(self.controls, values)
        margin_N = read["margin_N"] if read["program"] == NO_JUMP else None
        subject = {k: v for k, v in read.items() if k != "speed_rpm"}
        key, exact = json.dumps([coarse, subject]), json.dumps([False, subject])
        if exact in self._designs:
            key = exact
        if key in self._designs:
            self._designs.move_to_end(key)
            return self._designs[key]
        scene = edited_scene(self.scene, read)
        made_of = (scene.valve, scene.seat, scene.mass, scene.element, scene.force)
        if self._train is None or self._train[0] != made_of:  # an unchanged train is kept with its caches
            self._train = made_of, build_train(scene)
        train = self._train[1]
        with THREADS.limit(limits=1, user_api="blas"):  # threads slow down small matrices
            cam = self._cams.largest(scene, train, margin_N, coarse)
        edited = self._designs[key if cam.coarse or cam.says else exact] = EditedDesign(scene, train, cam)
        while len(self._designs) > REMEMBERED:
            self._designs.popitem(last=False)
        return edited

    def _cam_answer(self, design: EditedDesign, speed_rpm: float) -> dict[str, Any]:
        scene, cam = design.scene, design.cam
        broken = broken_by_shape(cam.lift, scene.required_design)
        motion, self._end = motion_at(scene, design.train, cam.lift, speed_rpm, cam.coarse, self._end)
        at_rest = radii_held_near(scene.required_design) if cam.coarse else ()
        return {
            "coarse": cam.coarse,
            "program": cam.program,
            "says": cam.says,
            "speeds_rpm": program_speeds_rpm(scene),
            "area_ratio": cam.area_ratio,
            "area_mm_deg": cam.lift.area / MM / DEG,
            "max_lift_mm": cam.lift.max_lift / MM,
            "worth": cam.worth,
            "margin_price": cam.margin_price,
            "broken_by_shape": [key for key in broken if key not in at_rest],
            "looked_for": [key for key in broken if key in at_rest],
            "curves": curves(cam.lift),
            "motion": motion,
        }


def no_answer(error: Exception) -> dict[str, Any]:
    """The reply to values that are refused or have no cam."""
    if isinstance(error, Refused):
        return {"state": "refused", "faults": error.faults}
    return {"state": "no cam", "says": str(error)}


@contextmanager
def cancellable(wanted: Callable[[], bool]) -> Iterator[None]:
    """Context in which the next linear program raises Cancelled once `wanted` returns False."""

    def watch() -> None:
        if not wanted():
            raise Cancelled

    token = WATCH.set(watch)
    try:
        yield
    finally:
        WATCH.reset(token)


def curves(lift: Lift) -> dict[str, np.ndarray]:
    """Lift and its derivatives by cam angle, from -180 to 180 deg."""
    angle, *laws = lift_table(lift, LAW_STEP_DEG).items()
    rounded = {key: np.round(law, digits) for (key, law), digits in zip(laws, DECIMALS, strict=True)}
    return {"angle_deg": angle[1], **rounded}
