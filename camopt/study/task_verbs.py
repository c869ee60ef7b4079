"""The verbs of tasks (`camopt.tasks`): each computes one task and returns plain numbers by name."""

from functools import lru_cache

from camopt.cam.design_file import lift_of_text
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.exact.settled import settled_metrics
from camopt.exact.settled.figures import NAMES
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import motion_limits
from camopt.optimizer.as_built.measured import Track, track
from camopt.scene import Scene, build_train
from camopt.scene.load import scene_with
from camopt.scene.quantities import LESS_IS_WORSE
from camopt.scene.schema import SIMULATED
from camopt.scene.settled import RANGED
from camopt.study.simulate.motion import simulate
from camopt.tasks.task import SettledTask, SimulateTask, TaskOnScene, YieldTask, scene_of_text

Numbers = tuple[tuple[str, float], ...]


def settled_task(task: SettledTask) -> dict:
    """Lowest and highest value of every metric over the measured revolutions of the settled motion, from rest.

    Also `broken`, the limits on the motion that the worst values break, `periodic`, `refused` and `revolutions`.
    """
    scene, cam = scene_and_cam(task)
    speeds = [scene.cam_speed(task.speed_rpm)]
    metrics = settled_metrics([build_train(scene)], [cam], speeds, aperiodic=RANGED, workers=1)
    limits = motion_limits(scene.design)
    broken = [key for key, limit in limits.items() if limit.breaks(float(metrics.worst(limit.metric)[0, 0, 0]))]
    values = {f"{name}_low": metrics.lowest[name][0, 0, 0] for name in NAMES}
    values |= {f"{name}_high": metrics.highest[name][0, 0, 0] for name in NAMES}
    flags = {key: getattr(metrics, key)[0, 0, 0] for key in ("periodic", "refused", "revolutions")}
    return {**values, **flags, "broken": broken}


def simulate_task(task: SimulateTask) -> dict:
    """The worst value of each metric over all revolutions from rest but the last, and the largest valve position."""
    scene, cam = scene_and_cam(task)
    settings = {"revolutions": task.revolutions, "step_deg": task.step_deg}
    motion = simulate(scene, cam, task.speed_rpm, task.method, **settings)
    worst = {name: motion[name].values for name in NAMES if name in motion}
    extreme = {name: float(v.min() if name in LESS_IS_WORSE else v.max()) for name, v in worst.items()}
    return extreme | {"valve_max_mm": float(motion["position_mm"].sel(mass=scene.valve).max())}


def yield_task(task: YieldTask) -> dict:
    """The usage of each limit by one drawn train at each speed (`used_<limit>`), the `worst`, and whether it holds."""
    scene, _ = scene_and_cam(task)
    (train,) = trains_as_built(scene, 1, seed=task.seed, first=task.train)
    (used,) = _track(task.scene, _varied(task), task.cam, task.speeds_rpm).used([train])
    by_limit = dict(zip(motion_limits(scene.design), used, strict=True))
    worst = float(used.max()) if len(by_limit) else 0.0
    return {**{f"used_{limit}": shares for limit, shares in by_limit.items()}, "worst": worst, "holds": worst <= 1.0}


def _varied(task: TaskOnScene) -> Numbers:
    return tuple(sorted(task.vary.items()))


def scene_and_cam(task: TaskOnScene) -> tuple[Scene, Lift]:
    """The scene of a task with its varied numbers, and its cam; a family's member is designed for this scene."""
    return _scene(task.scene, _varied(task)), _cam(task.scene, _varied(task), task.cam)


@lru_cache(maxsize=64)
def _scene(text: str, numbers: Numbers) -> Scene:
    return scene_with(scene_of_text(text), dict(numbers), "vary", SIMULATED)


@lru_cache(maxsize=64)
def _cam(text: str, numbers: Numbers, cam: str) -> Lift:
    scene = _scene(text, numbers)
    if not cam.startswith("{"):
        return read_cam(cam, scene)
    return lift_of_text(cam, scene, "the task's cam")


@lru_cache(maxsize=16)
def _track(text: str, numbers: Numbers, cam: str, speeds_rpm: tuple[float, ...]) -> Track:
    """As in `camopt yield`, drawn trains start from the settled states of the train as designed."""
    return track(_scene(text, numbers), _cam(text, numbers, cam), speeds_rpm)
