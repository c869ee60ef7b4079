"""What does the exact gradient cost compared with its value?

Measured is the processor time of one event-exact revolution from rest with one metric, and of the same with its
gradient by the free coefficients of a spline cam. Each is the least of many repeats, which alternate so that a loaded
machine slows both.
"""

import numpy as np

from camopt.cam.families.free import FreeCam, free_cam
from camopt.exact.adjoint.motion import TracedMotion
from camopt.scene import build_train, load_scene
from camopt.scene.rest import state_at_rest
from experiments.chords import least
from experiments.support.record import RESULTS, run_script, write_result

SIZES = {"small": (20, (6000.0,)), "full": (400, (5000.0, 6000.0, 6500.0, 7000.0))}
"""Repeats, speeds."""
COEFFICIENTS = 20, 200
METRICS = "seating_velocity_m_per_s", "bounce_mm", "contact_force_max_N", "dynamic_area_mm_deg"


def main(size: str, folder=RESULTS) -> dict:
    """Times and their ratios; small: one speed, few repeats."""
    repeats, speeds = SIZES[size]
    scene = load_scene("kodama")
    train = build_train(scene)
    start, rows, design = state_at_rest(train), [], scene.required_design
    for count in COEFFICIENTS:
        cam = free_cam(design, design.duration_deg / (count + 1))
        z = bell(cam)
        lift, by_z = cam.lift(z), pieces_by_z(cam)
        for rpm in speeds:
            for metric in METRICS:

                def motion(lift=lift, rpm=rpm):
                    return TracedMotion(train, lift, scene.cam_speed(rpm), start)

                def value(motion=motion, metric=metric):
                    return motion().values([metric])

                def gradient(motion=motion, metric=metric, by_z=by_z):
                    return by_z @ motion().swept([metric])[1].by_coefficients.ravel()

                one, both = (1e3 * seconds for seconds in least([value, gradient], repeats))
                row = {"coefficients": len(z), "speed_rpm": rpm, "metric": metric, "value_ms": one}
                rows.append(row | {"value_and_gradient_ms": both, "ratio": both / one})
    worst = {str(n): max(r["ratio"] for r in rows if r["coefficients"] == n) for n in COEFFICIENTS}
    content = {"repeats": repeats, "rows": rows, "worst_ratio": worst}
    return write_result("gradient_cost", size, content, {}, folder)


def bell(cam: FreeCam) -> np.ndarray:
    """Free coefficients (m) nearest to a smooth bell-shaped lift's acceleration."""
    shape = -0.004 * np.cos(np.linspace(-3.2, 3.2, len(cam.x_p)))
    return cam.Z.T @ (shape - cam.x_p)


def pieces_by_z(cam: FreeCam) -> np.ndarray:
    """Derivatives (m, p q) of the pieces' coefficients by z, in which they are linear."""
    zero = np.zeros(cam.Z.shape[1])
    offset = cam.lift(zero).coefficients
    return np.stack([(cam.lift(unit).coefficients - offset).ravel() for unit in np.eye(len(zero))])


if __name__ == "__main__":
    run_script(main, __doc__)
