"""How accurate is the cam acceleration that is computed from a measured lift table?

The true cam is the polydyne of `kodama`. Its tables cover a whole turn in steps of 0.25 to 2 cam degrees with normal
noise of 0.5 to 10 um on every row, base circle included, rounded to 0.1 um. Each table is smoothed by camopt, which
does not know the noise, and is also interpolated without smoothing. Errors are over the event, at the angles of the
table. The same kind of tables is then generated for every family, with and without the jerk limit, and the true errors
of the acceleration (root mean square over the event, and the larger error of its two extremes) are compared with the
errors stated at 95 %. The two measured motorbike tables are included where they exist in ../shared/data/lift beside the
repository.
"""

from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PPoly, make_interp_spline

from camopt.cam.ramps import scene_ramps
from camopt.cam.read import read_cam
from camopt.cam.tables.smoothing import ERROR_FACTOR, smoothed
from camopt.scene import InputError, load_scene
from camopt.scene.units import DEG, MM
from experiments.support.panels import POINTS, Panel, panels
from experiments.support.record import RESULTS, run_script, write_result

MEASURED = Path(__file__).resolve().parents[2] / "shared" / "data" / "lift"
TABLES = ("motorbike-exhaust-ramps", "motorbike-intake-coarse")
NOISES_UM = (0.5, 1.0, 2.0, 5.0, 10.0)
STEPS_DEG = (0.25, 0.5, 1.0, 2.0)
FAMILIES = ("polydyne", "exponent", "multi-pol", "new-design", "kurz", "trapezoid", "cycloidal", "4-5-6-7")
STEPPING = ("multi-pol:jerk=no", "new-design:jerk=no", "trapezoid:jerk=no")
FEW = ("polydyne", "trapezoid:sections_deg=5/8/13/46")
RAMPS = scene_ramps(load_scene("kodama", need=("design",)).design)
EVENT = np.linspace(-102.0, 102.0, 4081)


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Errors over noise, step and seed, and the measured tables where they exist; writes JSON and figures."""
    scene = load_scene("kodama")
    truth = read_cam("polydyne", scene)
    noises, steps, seeds = (NOISES_UM, STEPS_DEG, 20) if size == "full" else ((1.0, 10.0), (0.5, 2.0), 2)
    rows = [cell(truth, noise, step, seeds) for step in steps for noise in noises]
    measured, drawn = {}, {}
    for name in TABLES:
        file = MEASURED / f"{name}.dat"
        if not file.is_file():
            measured[name] = "skipped: not on this machine"
            continue
        lift = read_cam(file, scene, "crank", "m")
        table = np.loadtxt(file)
        low, high = (value / MM * DEG**2 for value in lift.extremes(2))
        limits = {"acceleration_min_mm_per_deg2": low, "acceleration_max_mm_per_deg2": high}
        measured[name] = lift.parameters | limits | {"duration_deg": 2 * lift.half_duration / DEG}
        drawn[name] = (lift, 0.5 * table[:, 0], 1e3 * table[:, 1])
    peak = float(np.abs(truth.extremes(2)).max() / MM * DEG**2)
    names = (*FAMILIES, *STEPPING) if size == "full" else FEW
    held = {name: coverage(read_cam(name, scene), noises, steps, 6 if size == "full" else 1) for name in names}
    content = {"truth_peak_acceleration_mm_per_deg2": peak, "generated": rows, "stated": held, "measured": measured}
    figures = {"error": draw_errors(rows, peak), "example": draw_example(truth)} if size == "full" else {}
    if drawn and size == "full":
        figures["motorbike"] = draw_measured(drawn)
    return write_result("measured_tables", size, content, figures, folder)


def generated(truth, noise_um: float, step: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles [deg] and lift [mm] of a noisy table over a turn that closes on itself."""
    degrees = np.arange(-180.0, 180.0 + step / 2, step)
    lift = truth(degrees * DEG) / MM + np.random.default_rng(seed).normal(0, 1e-3 * noise_um, len(degrees))
    lift[-1] = lift[0]
    return degrees, np.round(lift, 4)


class ReadTable(NamedTuple):
    """A generated table and the lift law that camopt fits to it."""

    degrees: np.ndarray  # (r) over a turn
    lift: np.ndarray  # (r) [mm]
    pieces: PPoly
    report: dict

    def over_event(self, order: int) -> np.ndarray:
        """The law's derivative of this order [mm/deg^order] at the angles EVENT."""
        return self.pieces(np.mod(EVENT, 360.0), order)


def read_table(truth, noise_um: float, step: float, seed: int) -> ReadTable | None:
    """A generated table, smoothed; None where it is refused."""
    degrees, lift = generated(truth, noise_um, step, seed)
    try:
        pieces, report = smoothed("generated", degrees, lift, list(range(len(lift))), RAMPS)
    except InputError:
        return None
    assert pieces is not None, "a noisy table is smoothed"
    return ReadTable(degrees, lift, pieces, report)


def coverage(truth, noises, steps, seeds: int) -> dict:
    """Share of tables within the errors stated at 95 %, and median and 95th percentile of true over stated error."""
    tables = [read_table(truth, *drawn) for drawn in product(noises, steps, range(1000, 1000 + seeds))]
    accepted = [table for table in tables if table is not None]
    ratios, acceleration = [], truth(EVENT * DEG, 2) / MM * DEG**2
    for table in accepted:
        fitted = table.over_event(2)
        largest = np.abs(fitted).max() / 100
        rms = np.sqrt(np.mean((fitted - acceleration) ** 2))
        extremes = max(abs(fitted.max() - acceleration.max()), abs(fitted.min() - acceleration.min()))
        stated = table.report["acceleration_error_percent"], table.report["peak_error_percent"]
        ratios.append((rms / (largest * stated[0]), extremes / (largest * stated[1])))
    result: dict = {"tables": len(tables), "refused": len(tables) - len(accepted)}
    for name, ratio in zip(("acceleration", "peak"), np.array(ratios).T, strict=True):
        result[f"{name}_within"] = float(np.mean(ratio <= 1))
        result[f"{name}_median_ratio"], result[f"{name}_ratio_95"] = (float(q) for q in np.quantile(ratio, (0.5, 0.95)))
    return result


def cell(truth, noise_um: float, step: float, seeds: int) -> dict:
    """Errors at one noise and step, averaged over the accepted tables (largest values: over all of them)."""
    true = [truth(EVENT * DEG, k) / MM * DEG**k for k in (0, 2)]
    tables = [read_table(truth, noise_um, step, seed) for seed in range(seeds)]
    accepted = [table for table in tables if table is not None]
    shared = {"noise_um": noise_um, "step_deg": step, "tables": seeds, "refused": seeds - len(accepted)}
    if not accepted:
        return shared
    errors = []  # of each table: those of camopt and of plain interpolation, in lift and in acceleration
    for table in accepted:
        plain = make_interp_spline(table.degrees, table.lift, 5, bc_type="periodic")
        fitted = [table.over_event(k) - t for k, t in zip((0, 2), true, strict=True)]
        interpolated = [plain(EVENT, k) - t for k, t in zip((0, 2), true, strict=True)]
        errors.append([*fitted, *interpolated])
    rms = [[float(np.sqrt(np.mean(e**2))) for e in kind] for kind in zip(*errors, strict=True)]
    worst = [max(float(np.abs(e).max()) for e in kind) for kind in zip(*errors, strict=True)]
    peak = np.abs(true[1]).max()
    reports = [table.report for table in accepted]
    mean = [float(np.mean(r)) for r in rms]
    stated = float(np.mean([r["acceleration_error_percent"] for r in reports]))
    return shared | {
        "noise_estimated_um": float(np.mean([r["noise_um"] for r in reports])),
        "rows_rejected": sum(r["outliers"] for r in reports),
        "lift_rms_um": 1e3 * mean[0], "lift_max_um": 1e3 * worst[0],
        "acceleration_rms_mm_per_deg2": mean[1], "acceleration_max_mm_per_deg2": worst[1],
        "acceleration_rms_percent": 100 * mean[1] / peak,
        "acceleration_estimated_percent": stated / ERROR_FACTOR,  # the standard error, which the stated one exceeds
        "acceleration_stated_percent": stated,
        "peak_stated_percent": float(np.mean([r["peak_error_percent"] for r in reports])),
        "plain_lift_rms_um": 1e3 * mean[2], "plain_acceleration_rms_mm_per_deg2": mean[3],
        "plain_acceleration_max_mm_per_deg2": worst[3],
    }  # fmt: skip


def draw_errors(rows: list[dict], peak: float) -> Figure:
    """RMS error of lift and acceleration against the noise, by step of the table; dashed: plain interpolation."""
    lift, acceleration = [("noise itself", NOISES_UM, NOISES_UM)], []
    for step in STEPS_DEG:
        cells = [r for r in rows if r["step_deg"] == step and r["refused"] < r["tables"]]
        noise = [r["noise_um"] for r in cells]
        lift.append((f"{step:g} deg", noise, [r["lift_rms_um"] for r in cells]))
        for key, name in (("acceleration_rms", "{:g} deg"), ("plain_acceleration_rms", "{:g} deg, not smoothed")):
            share = [100 * r[f"{key}_mm_per_deg2"] / peak for r in cells]
            acceleration.append((name.format(step), noise, share))
    row = [Panel("lift error [um]", lift), Panel("acceleration error [% of peak]", acceleration)]
    return panels([row], "noise of a row [um]", None, 7.2, 2.7, scale=("log", "log"), marker="o")


ROWS = "second differences of the rows"


def draw_example(truth) -> Figure:
    """Acceleration from one table: truth, second differences of the rows, smoothed."""
    table = read_table(truth, 2.0, 1.0, 0)
    assert table is not None, "so little noise is not refused"
    true = truth(EVENT * DEG, 2) / MM * DEG**2
    curves = [
        (ROWS, table.degrees[1:-1], np.diff(table.lift, 2)),
        ("truth", EVENT, true),
        ("smoothed", EVENT, table.over_event(2)),
    ]
    panel = Panel("acceleration [mm/deg²]", curves, "1 deg steps, noise 2 um")
    return panels([[panel]], "cam angle [deg]", (-110, 110), 7.2, 2.6, look={ROWS: POINTS})


def draw_measured(drawn: dict) -> Figure:
    """Acceleration of the measured tables: divided second differences of the rows, and the law."""
    rows = []
    for name, (lift, degrees, height) in drawn.items():
        slope = np.diff(height) / np.diff(degrees)
        second = np.diff(slope) / (0.5 * (degrees[2:] - degrees[:-2]))
        nose = degrees[np.argmax(height)] - float(EVENT[np.argmax(lift(EVENT * DEG))])
        angle = np.mod(degrees[1:-1] - nose + 180, 360) - 180
        low, high = (value / MM * DEG**2 for value in lift.extremes(2))
        margin = 0.35 * (high - low)
        curves = [(ROWS, angle, second), ("smoothed", EVENT, lift(EVENT * DEG, 2) / MM * DEG**2)]
        title = f"{name}: noise {lift.parameters['noise_um']:.2g} um"
        rows.append([Panel("acceleration [mm/deg²]", curves, title, (low - margin, high + margin))])
    xlabel = "cam angle from the middle of the duration [deg]"
    return panels(rows, xlabel, (-102, 102), 7.2, 2.3, look={ROWS: POINTS})


if __name__ == "__main__":
    run_script(main, __doc__)
