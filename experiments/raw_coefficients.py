"""Why do gradients by the raw coefficients of a cam's pieces differ between the exact and the smooth path?

A change of one coefficient of one piece changes the lift on one side of a border only: it makes a step in lift or
velocity, and the response to a step is not defined equally on the two paths. The exact path uses the step itself, the
smooth path interpolates the lift by cubics between samples. Therefore the two gradients of the seating velocity are
compared three times: along all directions, along those that keep the lift continuous, and along those that keep lift
and velocity continuous, as the parameters of every family do.
"""

from pathlib import Path

import jax
import numpy as np

import camopt
from camopt.cam.lift import Lift
from camopt.study.simulate.motion import motion_parameters
from experiments.support.record import RESULTS, run_script, write_result

CASES = {"small": {"motori-1": 4000.0}, "full": {"kodama": 5500.0, "motori-1": 4000.0}}
"""Crankshaft speeds [r/min] at which nothing bounces."""
METRIC = "seating_velocity_m_per_s"
DIRECTIONS = {"all": (), "lift continuous": (0,), "lift and velocity continuous": (0, 1)}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Cosine, norm ratio and relative difference of the gradients, by scene and set of directions."""
    rows = []
    for name, rpm in CASES[size].items():
        scene = camopt.load_scene(name)
        cam = camopt.polydyne(scene)
        exact, smooth = (gradient(scene, cam, rpm, method) for method in ("event", "smooth"))
        for words, orders in DIRECTIONS.items():
            along = continuous(cam, orders)
            a, b = along @ exact, along @ smooth
            sizes = np.linalg.norm(a), np.linalg.norm(b)
            rows.append({
                "scene": name, "directions": words, "count": len(along), "cosine": float(a @ b / sizes[0] / sizes[1]),
                "norm_ratio": float(sizes[1] / sizes[0]), "difference": float(np.linalg.norm(b - a) / sizes[0]),
            })  # fmt: skip
    return write_result("raw_coefficients", size, {"metric": METRIC, "rows": rows}, {}, folder)


def gradient(scene, cam: Lift, rpm: float, method: str) -> np.ndarray:
    """Slopes (p * q) of the metric by the coefficients, each times the width of its piece to its power [m]."""

    def value(coefficients):
        return camopt.simulate(scene, cam, rpm, method, parameters={"lift": coefficients})[METRIC].data[0]

    slopes = np.asarray(jax.grad(value)(motion_parameters(scene, cam)["lift"]))
    return (slopes / np.diff(cam.borders)[:, None] ** np.arange(slopes.shape[1])).ravel()


def continuous(cam: Lift, orders: tuple[int, ...]) -> np.ndarray:
    """Orthonormal directions (d, p * q) in these coefficients without a step of the derivatives `orders` anywhere."""
    (pieces, powers), widths, rows = cam.coefficients.shape, np.diff(cam.borders), []
    for order in orders:
        falling = np.array([np.prod(np.arange(k, k - order, -1)) if k >= order else 0.0 for k in range(powers)])
        for i in range(pieces):
            row, j = np.zeros((pieces, powers)), (i + 1) % pieces
            row[i] = falling / widths[i] ** order
            row[j, order] -= falling[order] / widths[j] ** order
            rows.append(row.ravel())
    if not rows:
        return np.eye(pieces * powers)
    _, sizes, directions = np.linalg.svd(np.array(rows))
    return directions[int(np.sum(sizes > 1e-10 * sizes[0])) :]


if __name__ == "__main__":
    run_script(main, __doc__)
