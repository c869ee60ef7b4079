"""What the verbs of tasks (`camopt.tasks`) compute: each takes a task and returns plain numbers by name."""

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
from camopt.scene.settled import RANGED
from camopt.study.simulate.motion import simulate
from camopt.tasks.task import NEEDED, SettledTask, SimulateTask, TaskOnScene, YieldTask, scene_of_text


def settled_task(task: SettledTask) -> dict:
    """Lowest and highest value of every metric over the measured revolutions of the settled motion, from rest.

    Also `broken`, the limits on the motion that the worst of them breaks, `periodic`, `refused` and `revolutions`.
    """
    scene = scene_of(task)
    speeds = [scene.cam_speed(task.speed_rpm)]
    metrics = settled_metrics([build_train(scene)], [cam_of(task)], speeds, aperiodic=RANGED, workers=1)
    limits = motion_limits(scene.design)
    broken = [key for key, limit in limits.items() if limit.breaks(float(metrics.worst(limit.metric)[0, 0, 0]))]
    values = {f"{name}_low": metrics.lowest[name][0, 0, 0] for name in NAMES}
    values |= {f"{name}_high": metrics.highest[name][0, 0, 0] for name in NAMES}
    flags = {key: getattr(metrics, key)[0, 0, 0] for key in ("periodic", "refused", "revolutions")}
    return {**values, **flags, "broken": broken}


def simulate_task(task: SimulateTask) -> dict:
    """The worst of each metric over the revolutions from rest but the last, and the valve's largest position."""
    scene = scene_of(task)
    motion = simulate(
        scene, cam_of(task), task.speed_rpm, task.method, revolutions=task.revolutions, step_deg=task.step_deg
    )
    worst = {name: motion[name].values for name in NAMES if name in motion}
    extreme = {name: float(v.min() if name in LESS_IS_WORSE else v.max()) for name, v in worst.items()}
    return extreme | {"valve_max_mm": float(motion["position_mm"].sel(mass=scene.valve).max())}


def yield_task(task: YieldTask) -> dict:
    """How much of each limit one drawn train uses at each speed (`used_<limit>`), the `worst`, and whether it holds."""
    scene = scene_of(task)
    (one,) = trains_as_built(scene, 1, seed=task.seed, first=task.train)
    (used,) = _track(scene_key(task), task.cam, task.speeds_rpm).used([one])
    by_limit = dict(zip(motion_limits(scene.design), used, strict=True))
    worst = float(used.max()) if len(by_limit) else 0.0
    return {**{f"used_{limit}": shares for limit, shares in by_limit.items()}, "worst": worst, "holds": worst <= 1.0}


SceneKey = tuple[str, tuple[tuple[str, float], ...]]


def scene_key(task: TaskOnScene) -> SceneKey:
    """What makes the scene of a task: its text and the numbers that replace its own."""
    return task.scene, tuple(sorted(task.vary.items()))


def scene_of(task: TaskOnScene) -> Scene:
    """The scene of a task, with the numbers that it varies."""
    return _scene(scene_key(task))


@lru_cache(maxsize=64)
def _scene(key: SceneKey) -> Scene:
    text, numbers = key
    return scene_with(scene_of_text(text), dict(numbers), "vary", NEEDED)


def cam_of(task: TaskOnScene) -> Lift:
    """The cam of a task; a family's member is that of the task's own scene, its varied numbers included."""
    return _cam(task.cam, scene_key(task))


@lru_cache(maxsize=64)
def _cam(cam: str, key: SceneKey) -> Lift:
    scene = _scene(key)
    return lift_of_text(cam, scene, "the task's cam") if cam.startswith("{") else read_cam(cam, scene)


@lru_cache(maxsize=16)
def _track(key: SceneKey, cam: str, speeds_rpm: tuple[float, ...]) -> Track:
    """As in `camopt yield`: drawn trains settle from the states of the train as designed."""
    return track(_scene(key), _cam(cam, key), speeds_rpm)
