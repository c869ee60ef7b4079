"""Does the design job at draft accuracy end with a confirmed cam or a stated reason on each of ten ordinary trains
drawn at random?

The trains are bucket, finger and pushrod trains with rigid and elastic rods and two to fourteen masses, with numbers in
the range of real engines. Each goes through the whole job at draft accuracy, comparison included. A crash, or a verdict
without a reason, counts as a defect.
"""

import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import tomli_w
from matplotlib.figure import Figure

from camopt.optimizer.run import optimize
from camopt.plots.style import new_figure, styled
from camopt.scene import InputError, Scene, parse_scene
from experiments.support.record import RESULTS, called, run_script, write_result

SCENES = {"small": (8,), "full": range(10)}  # number 8 is a bucket train of two masses, the quickest
SPEEDS = {"small": "nominal", "full": "band"}
ARCHITECTURES = ("bucket", "finger", "pushrod", "pushrod-elastic")
DAMPING = 0.02, 0.06
"""Damping ratios of contacts, stems and rods, each against the mass that it carries."""
COIL_DAMPING = 0.005, 0.03
ACCELERATION = 1.6
"""Ratio of the largest spring force to the force that the valve side needs at the nose and the top speed."""
NOSE_MM_PER_DEG2 = 0.008
LUMPED = 0.25
"""Share of the trains whose valve spring has no masses of its own."""
DEFECT = "defect"


def drawn(number: int) -> Scene:
    """The train of a number: the architectures take turns, the numbers are drawn at random."""
    rng = np.random.default_rng([13, number])
    kind = ARCHITECTURES[number % len(ARCHITECTURES)]
    data = train(rng, kind)
    return parse_scene(tomli_w.dumps({**data, "name": f"{kind}-{number}"}), f"{kind} {number}")


def train(rng: np.random.Generator, kind: str) -> dict:
    """A scene as the data of its file: parts from the cam to the valve, a spring of coils, and a seat."""
    low, high = (2500.0, 4500.0) if kind.startswith("pushrod") else (4000.0, 6500.0)  # crankshaft [r/min]
    parts = chain(rng, kind)
    coils = 0 if rng.random() < LUMPED else int(rng.integers(1, 15 - len(parts)))
    masses = [{"name": name, "mass_kg": mass} for name, mass, _, _ in parts]
    side = sum(mass for _, mass, _, _ in parts)
    need = side * NOSE_MM_PER_DEG2 * 1e-3 * (180 / np.pi) ** 2 * (high / 2 * 2 * np.pi / 60) ** 2
    force, lift = ACCELERATION * need, 9.0e-3
    preload = force * rng.uniform(0.4, 0.55)
    rate = (force - preload) / lift
    elements = []
    for i, (name, mass, joint, stiffness) in enumerate(parts):
        before = "ground" if i == 0 else parts[i - 1][0]
        elements.append(element(rng, f"{before}_{name}", joint, before, name, stiffness, mass, cam_driven=i == 0))
        if joint == "contact" and 0 < i:
            masses[i - 1]["force_N"] = -0.05 * preload
    contacts = [e for e in elements if e["kind"] == "contact"]
    contacts[-1]["gap_mm"] = float(rng.uniform(0.12, 0.22))
    valve = parts[-1][0]
    elements += spring(rng, masses, valve, rate, preload, coils)
    seat = element(rng, "seat", "contact", "ground", valve, float(rng.uniform(5e7, 1e8)), parts[-1][1])
    elements.append({**seat, "damping_N_s_per_m": 4 * seat["damping_N_s_per_m"], "preload_N": preload})
    speeds = [float(low), float(high)]
    operation = {"speeds_rpm": speeds, "band_rpm": speeds, "cam_per_crank": 0.5}
    return {"format": 1, "name": kind, "valve": valve, "seat": "seat", "operation": operation,
            "design": design(rng), "mass": masses, "element": elements}  # fmt: skip


def chain(rng: np.random.Generator, kind: str) -> list[tuple[str, float, str, float]]:
    """Parts from the cam to the valve: name, mass [kg], kind of the joint to the previous part, stiffness [N/m]."""
    contact = lambda: float(rng.uniform(4e7, 1.2e8))  # noqa: E731
    head, stem = ("valve", float(rng.uniform(0.04, 0.09))), float(rng.uniform(6e7, 1.5e8))
    if kind == "bucket":
        return [("bucket", float(rng.uniform(0.03, 0.06)), "contact", contact()), (*head, "contact", contact())]
    if kind == "finger":
        tip = ("tip", float(rng.uniform(0.02, 0.04)), "contact", contact())
        return [("finger", float(rng.uniform(0.03, 0.06)), "contact", contact()), tip, (*head, "spring", stem)]
    lifter = ("lifter", float(rng.uniform(0.04, 0.06)), "contact", contact())
    rod = float(rng.uniform(1.5e7, 4e7))
    if kind == "pushrod":
        return [lifter, ("rocker", float(rng.uniform(0.03, 0.05)), "contact", rod), (*head, "contact", contact())]
    foot = ("rod_foot", float(rng.uniform(0.01, 0.02)), "contact", contact())
    rocker = ("rocker", float(rng.uniform(0.03, 0.05)), "spring", rod)
    return [lifter, foot, rocker, (*head, "contact", contact())]


def element(rng, name: str, kind: str, a: str, b: str, stiffness: float, mass: float, **more) -> dict:
    """An element whose damping ratio is drawn."""
    damping = 2 * float(rng.uniform(*DAMPING)) * float(np.sqrt(stiffness * mass))
    return {"name": name, "kind": kind, "between": [a, b], "stiffness_N_per_m": stiffness,
            "damping_N_s_per_m": damping, **more}  # fmt: skip


def spring(rng, masses: list[dict], valve: str, rate: float, preload: float, coils: int) -> list[dict]:
    """The elements of the valve spring: one, or equal ones between `coils` masses, which are appended to `masses`."""
    weight, one = 0.04, (coils + 1) * rate
    names = [valve, *(f"coil_{i + 1}" for i in range(coils)), "ground"]
    masses += [{"name": name, "mass_kg": weight / (coils + 1)} for name in names[1:-1]]
    ratio = float(rng.uniform(*COIL_DAMPING))
    damping = 2 * ratio * np.sqrt(one * weight / (coils + 1))
    ends = pairwise(names)
    return [{"name": f"spring_{i + 1}", "kind": "spring", "between": list(pair), "stiffness_N_per_m": one,
             "damping_N_s_per_m": float(damping), "preload_N": preload} for i, pair in enumerate(ends)]  # fmt: skip


def design(rng: np.random.Generator) -> dict:
    """Conditions and limits of the built-in scenes with a drawn duration and lift; some have unequal ramps."""
    limits = {"acceleration_max_mm_per_deg2": 0.015, "acceleration_min_mm_per_deg2": -NOSE_MM_PER_DEG2}
    conditions = {"duration_deg": float(rng.integers(140, 152)), "max_lift_mm": float(rng.uniform(8.5, 9.5)),
             "ramp_height_mm": 0.3, "ramp_velocity_mm_per_deg": 0.012, "ramp_foot_deg": 10.0, **limits,
             "jerk_max_mm_per_deg3": 0.003, "nose_deg": 35.0, "bounce_max_mm": 0.05, "jump_max_mm": 0.05,
             "seating_velocity_max_m_per_s": 0.8}  # fmt: skip
    return conditions | ({"closing_ramp_velocity_mm_per_deg": 0.009} if rng.random() < 0.3 else {})


def job(scene: Scene, folder: Path, speeds: str = "band") -> dict:
    """Outcome of the job on a scene: its verdict, the sentence of a refusal, or the defect."""
    begin = time.perf_counter()
    row = {"scene": scene.name, "masses": len(scene.mass), "contacts": sum(e.kind == "contact" for e in scene.element)}
    try:
        run = optimize(scene, speeds, "draft", "none", folder)
    except InputError as refusal:
        return row | {"ends": "refused", "sentence": str(refusal), "seconds": time.perf_counter() - begin}
    except Exception as error:  # the defects that this experiment is meant to find
        return row | {"ends": DEFECT, "sentence": f"{type(error).__name__}: {error}"}
    record, failed = run.record, _failed_families(folder)
    return row | {
        "ends": run.verdict.verdict,
        "sentence": run.verdict.reason,
        "area_ratio": record["area_ratio"],
        "area_ratio_bound": record["area_ratio_bound"],
        "failed_families": failed,
        "seconds": time.perf_counter() - begin,
    }


def job_on_draw(number: int, speeds: str) -> dict:
    """Outcome of the job on a drawn train."""
    with tempfile.TemporaryDirectory() as runs:
        return job(drawn(number), Path(runs) / "run", speeds)


def _failed_families(folder: Path) -> dict[str, str]:
    """Families without a cam in the comparison, with the reasons."""
    from pandas import read_csv

    rows = read_csv(folder / "comparison.csv")
    rows = rows[rows["verdict"] == "failed"]
    return dict(zip(rows["cam"], rows["broken"], strict=True))


def main(size: str, folder=RESULTS) -> dict:
    """Draws the trains, runs the job on each, prints and writes `architectures.json`."""
    cases = ({"number": number, "speeds": SPEEDS[size]} for number in SCENES[size])
    rows = called("experiments.architectures:job_on_draw", cases, size)
    ends = {e: sum(r["ends"] == e for r in rows) for e in sorted({r["ends"] for r in rows})}
    content = {"trains": len(rows), "ends": ends, "rows": rows}
    return write_result("architectures", size, content, {"areas": figure(rows)} if size == "full" else {}, folder)


@styled
def figure(rows: list[dict]) -> Figure:
    """Area ratio of every train with its certified bound; a refused train has neither."""
    drawing = new_figure(7.0, 3.6)
    axes = drawing.subplots()
    at = np.arange(len(rows))
    for key, mark, label in (("area_ratio_bound", "_", "certified bound"), ("area_ratio", "o", "design")):
        axes.plot(at, [r.get(key, np.nan) for r in rows], mark, label=label)
    axes.set_xticks(at, [f"{r['scene']}\n{r['ends']}" for r in rows], rotation=60, ha="right")
    axes.set_ylabel("area ratio")
    axes.legend()
    return drawing


if __name__ == "__main__":
    run_script(main, __doc__)
