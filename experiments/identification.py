"""Can masses, stiffnesses and dampings be identified from a simulated valve lift with 2 um of noise?

The true train is the built-in scene with a polydyne cam. The data are valve positions every 0.1 cam degrees over the
event, in the first revolution from rest, at speeds below the first jump, with white noise of 2 um. In every fit the
start value of each free parameter is wrong by up to 20 %. Known are the values that a test bench gives (static rates
and preloads of the spring, masses on the cam's side of the rocker); without them positions do not determine the scale
of all forces.
"""

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.polydyne import polydyne
from camopt.plots.style import INK, LIMIT, new_figure, styled
from camopt.scene import load_scene
from camopt.study.identify.identification import MeasuredLift, identify
from camopt.study.identify.lift_fit import FreeParameters
from camopt.study.simulate.motion import simulate
from experiments.support.record import RESULTS, run_script, write_result

NOISE_UM = 2.0
OFF = 0.2
"""Largest relative error of a start value."""
CASES = {
    "motori-1": (
        (3000, 3500, 4000, 4500),
        ("valve.mass_kg", "train.stiffness_N_per_m", "train.damping_N_s_per_m", "train.gap_mm",
         "seat.stiffness_N_per_m", "seat.damping_N_s_per_m", "spring.damping_N_s_per_m"),
    ),
    "pushrod-5mass": (
        (2000, 3000, 4000),
        ("valve.mass_kg", "spring_*.mass_kg", "pushrod.stiffness_N_per_m", "pushrod.damping_N_s_per_m",
         "rocker_valve.stiffness_N_per_m", "rocker_valve.damping_N_s_per_m", "rocker_valve.gap_mm",
         "seat.stiffness_N_per_m", "seat.damping_N_s_per_m", "coil_*.damping_N_s_per_m"),
    ),
}  # fmt: skip
SIZES = {"small": (("motori-1",), 1, 0.2), "full": (tuple(CASES), 12, 0.1)}
"""Scenes, seeds, degrees between samples."""


def main(size: str, folder=RESULTS) -> dict:
    """Fits every scene and seed: true value, start, estimate, interval and its coverage; with the counts."""
    scenes, seeds, step_deg = SIZES[size]
    content: dict = {"noise_um": NOISE_UM, "confidence": 0.95, "fits": []}
    figures = {}
    for name in scenes:
        fits = [fit(name, seed, step_deg) for seed in range(seeds)]
        content["fits"] += fits
        rows = [row for f in fits for row in f["parameters"] if row["identified"]]
        counted = {"covered": sum(r["covered"] for r in rows), "intervals": len(rows)}
        content[name] = counted | {"sound": sum(not f["remarks"] for f in fits), "fits": len(fits)}
        figures[name] = figure(name, fits)
    return write_result("identification", size, content, figures if size == "full" else {}, folder)


def fit(name: str, seed: int, step_deg: float) -> dict:
    """One simulated measurement of a built-in scene, and the parameters identified from it."""
    speeds, free = CASES[name]
    scene, random = load_scene(name), np.random.default_rng(seed)
    lift, truth = polydyne(scene), FreeParameters(scene, free)
    measured = []
    for speed in speeds:
        motion = simulate(scene, lift, speed, revolutions=1, step_deg=step_deg)
        motion = motion.sel(sample=(motion.cam_angle_deg > -115) & (motion.cam_angle_deg < 160))
        valve = motion["position_mm"].sel(mass=scene.valve).values
        noise = 1e-3 * NOISE_UM * random.standard_normal(len(valve))
        measured.append(MeasuredLift(speed, motion.cam_angle_deg.values, valve + noise))
    start = truth.moved_scene(np.log(random.uniform(1 - OFF, 1 + OFF, len(free))))
    fitted = identify(start, lift, measured, free, noise_um=NOISE_UM)
    rows = []
    for tied in truth.tied:
        row = fitted.table.sel(parameter=tied.name)
        low, high, identified = float(row.low), float(row.high), bool(row.identified)
        rows.append({"parameter": tied.name, "truth": tied.of(scene), "start": float(row.start),
                     "estimate": float(row.estimate), "identified": identified,
                     "low": low if identified else None, "high": high if identified else None,
                     "covered": identified and low <= tied.of(scene) <= high})  # fmt: skip
    return {"scene": name, "seed": seed, "noise_um": fitted.noise_um, "jacobian_error": fitted.jacobian_error,
            "steps": fitted.steps, "remarks": list(fitted.remarks), "parameters": rows}  # fmt: skip


@styled
def figure(name: str, fits: list[dict]) -> Figure:
    """Every interval over its true value, for all seeds; start values are crosses."""
    names = [row["parameter"] for row in fits[0]["parameters"]]
    drawn = new_figure(7.6, 1.2 + 0.6 * len(names))
    axes = drawn.subplots()
    for k, one in enumerate(fits):
        for i, row in enumerate(one["parameters"]):
            at, truth = i + 0.6 * ((k + 0.5) / len(fits) - 0.5), row["truth"]
            axes.plot(row["start"] / truth, at, "x", color="#999999", markersize=3.5)
            if row["identified"]:
                colour = INK if row["covered"] else LIMIT
                axes.plot([row["low"] / truth, row["high"] / truth], [at, at], color=colour, linewidth=1.2)
                axes.plot(row["estimate"] / truth, at, "o", color=colour, markersize=3)
    axes.axvline(1.0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set(xlabel="over the truth (bars: 95 % intervals, red: missed; crosses: starts)",
             title=f"{name}: {len(fits)} noises of {NOISE_UM:g} µm")  # fmt: skip
    return drawn


if __name__ == "__main__":
    run_script(main, __doc__)
