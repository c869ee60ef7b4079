"""Which revolution after a start from rest shows whether the settled motion keeps its limits?

On every built-in scene with a design the plain members of four families and the free cam of largest area under the
limits on the shape run at speeds over the band. Bounce and jump of the first revolutions from rest by event-exact are
compared with those of the settled motion, both with respect to `LIMIT_MM`. A valve that never seats counts as an
infinite bounce.
"""

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.exact import settled_metrics
from camopt.exact.adjoint.motion import TracedMotion
from camopt.exact.affine.lines import rest_of
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, MotionRefused, Scene, build_train, load_scene
from experiments.support.record import RESULTS, run_script, write_result

SCENES = {
    "small": ("motori-1",),
    "full": (
        *("kodama", "motori-1", "motori-2", "kodama-hertz", "pushrod-5mass", "exhaust-gas", "finger-hydraulic"),
        *("pushrod-hydraulic", "race-nested"),
    ),
}
SPEEDS = {"small": 3, "full": 9}
FAMILIES = ("polydyne", "multi-pol", "kurz", "trapezoid")
METRICS = ("bounce_mm", "jump_mm")
LIMIT_MM = 0.05
REVOLUTIONS = 8
NEAR = 0.2
"""Relative difference from the settled value up to which a revolution counts as near."""


def cams(scene: Scene) -> Iterator[Lift]:
    """The cams of a scene; a family without a member for it is left out."""
    for family in FAMILIES:
        with suppress(InputError):
            yield read_cam(family, scene)
    yield kinematic_optimum(design := scene.required_design, free_cam(design, 6.0)).lift


def figures(scene: Scene, lift: Lift, speeds: list[float]) -> Iterator[np.ndarray]:
    """By speed [rad/s] the metrics of the first revolutions (REVOLUTIONS, 2) and, in the last row, the settled ones'
    worst [mm]; motions that are refused are left out."""
    train = build_train(scene)
    settled = settled_metrics([train], [lift], speeds)
    for i, speed in enumerate(speeds):
        with suppress(MotionRefused):
            motion = TracedMotion(train, lift, speed, rest_of(train), REVOLUTIONS + 1)
            rows = [motion.values(METRICS, r) for r in range(REVOLUTIONS)]
            rows.append(np.array([settled.worst(name)[0, 0, i] for name in METRICS]))
            yield np.nan_to_num(np.array(rows), nan=np.inf)


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `first_revolutions.json`."""
    metrics = []
    for name in SCENES[size]:
        scene = load_scene(name)
        speeds = [scene.cam_speed(rpm) for rpm in np.linspace(*scene.required_operation.band_rpm, SPEEDS[size])]
        for lift in cams(scene):
            metrics += figures(scene, lift, speeds)
    first, settled = np.array(metrics)[:, :-1], np.array(metrics)[:, -1:]
    in_revolution, true = first > LIMIT_MM, settled > LIMIT_MM
    both = np.isfinite(first) & np.isfinite(settled) & true
    share = np.divide(first, settled, out=np.ones_like(first), where=both)
    rows = [
        {
            "revolution": r + 1,
            "missed": int(np.sum(true[:, 0] & ~in_revolution[:, r])),
            "invented": int(np.sum(~true[:, 0] & in_revolution[:, r])),
            "near_percent": 100.0 * float(np.mean(np.abs(share[:, r][both[:, r]] - 1.0) <= NEAR)),
            "least_share": float(share[:, r].min()),
        }
        for r in range(REVOLUTIONS)
    ]
    content = {"motions": len(metrics), "figures": int(true.size), "broken": int(true.sum()), "rows": rows}
    return write_result("first_revolutions", size, content, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
