"""A motion as a labelled dataset with its metrics; the dataset as lines of text and as a table."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from camopt.cam.lift import Lift
from camopt.measure.metrics import measure
from camopt.scene import QUANTITIES, Response, Scene
from camopt.scene.units import MM

if TYPE_CHECKING:
    import xarray as xr


def recorded_metrics(response: Response, cam: Lift) -> dict[str, np.ndarray]:
    """The declared metrics of all revolutions but the last; NaN where the lift never takes up the lash."""
    measured = response.revolutions - 1
    if not response.train.cam_side:
        return {}
    if measured == 0 or cam.max_lift <= response.train.lash:
        return {name: np.full(measured, np.nan) for name in QUANTITIES}
    return measure(response, cam)


def motion_dataset(
    scene: Scene, cam: Lift, speed_rpm, method: str, response: Response, metrics: Mapping
) -> "xr.Dataset":
    """A motion on a regular grid, with metrics of all revolutions but the last, as `simulate` returns it."""
    import xarray as xr  # loads pandas, which unlabelled motions do not need

    train, steps = response.train, (len(response.angle) - 1) // response.revolutions
    sample = np.arange(len(response.angle))
    revolution = np.minimum(sample // steps, response.revolutions - 1)  # the last sample belongs to the last revolution
    angle_deg = -180.0 + (sample - revolution * steps) * (360.0 / steps)
    variables = {
        "lift_mm": ("sample", response.lift / MM, {"units": "mm", "long_name": "lift"}),
        "position_mm": (("sample", "mass"), response.x / MM, {"units": "mm", "long_name": "position"}),
        "velocity_m_per_s": (("sample", "mass"), response.v, {"units": "m/s", "long_name": "velocity"}),
        "force_N": (("sample", "element"), response.force, {"units": "N", "long_name": "force"}),
    }
    for name, values in metrics.items():
        declared = QUANTITIES.get(name)
        labels = {"units": declared.unit, "long_name": declared.label} if declared else {}
        variables[name] = ("measured", values, labels)
    coords = {
        "measured": np.arange(1, response.revolutions),
        "revolution": ("sample", revolution + 1),
        "cam_angle_deg": ("sample", angle_deg, {"units": "deg", "long_name": "cam angle"}),
        "time_s": ("sample", response.time, {"units": "s", "long_name": "time"}),
        "mass": list(train.mass_names),
        "element": list(train.element_names),
    }
    attributes = {"scene": scene.name, "cam": cam.family, "speed_rpm": speed_rpm, "method": method}
    return xr.Dataset(variables, coords, attributes)


def motion_lines(motion: "xr.Dataset", scene: Scene) -> list[str]:
    """The largest valve position and the range of each contact force, by revolution."""
    lines = []
    for revolution, samples in motion.groupby("revolution"):
        valve = samples["position_mm"].sel(mass=scene.valve)
        lines.append(f"revolution {revolution}: largest valve position {float(valve.max()):.4f} mm")
        for element in (e.name for e in scene.element if e.kind == "contact"):
            force = samples["force_N"].sel(element=element)
            lines.append(f"  {element:<20} force {float(force.min()):10.1f} to {float(force.max()):10.1f} N")
    return lines


def motion_table(motion: "xr.Dataset") -> Mapping[str, np.ndarray]:
    """Columns of `simulate --csv`: revolution, cam_angle_deg, time_s, then those of every mass and every element."""
    columns = {name: motion[name].values for name in ("revolution", "cam_angle_deg", "time_s")}
    for variable, dimension, unit in (
        ("position_mm", "mass", "mm"),
        ("velocity_m_per_s", "mass", "m_per_s"),
        ("force_N", "element", "N"),
    ):
        for i, name in enumerate(motion[dimension].values):
            columns[f"{name}_{unit}"] = motion[variable].values[:, i]
    return columns


def resampled(response: Response, steps: int) -> Response:
    """A motion on `steps` + 1 equally spaced angles over its whole range."""
    grid = np.linspace(response.angle[0], response.angle[-1], steps + 1)
    # a sample that differs from its grid angle by round-off must not end the interval before that angle
    left = np.searchsorted(response.angle, grid + 1e-12 * np.abs(grid[-1]), side="right") - 1
    left = np.minimum(left, len(response.angle) - 2)
    width = np.diff(response.angle)[left]
    s = np.divide(grid - response.angle[left], width, out=np.ones_like(grid), where=width > 0).clip(0.0, 1.0)
    lift = (1 - s) * response.lift[left] + s * response.lift[left + 1]
    force = (1 - s)[:, None] * response.force[left] + s[:, None] * response.force[left + 1]
    distinct = np.append(np.diff(response.angle) > 0, True)
    slope = response.v[distinct] / response.cam_speed
    motion = CubicHermiteSpline(response.angle[distinct], response.x[distinct], slope)
    return Response(
        response.train, response.cam_speed, grid, lift, motion(grid), motion(grid, 1) * response.cam_speed, force
    )
