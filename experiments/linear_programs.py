"""Does HiGHS decide every linear program of randomly drawn scenes, and what do bounds on the free columns change?

Scenes are drawn far beyond ordinary values: 1 to 60 mm of lift, two-stroke and four-stroke, slow and fast, limits from
tight to contradictory. For each scene the programs of a design are solved: the largest area, the same without jump at
several margins, and the same with penalised violation of the margins. Each is solved twice, by working sets that grow:
with free columns, and as camopt does, with columns that are first bounded by a box. A program is undecided if none of
the solver's attempts gives an optimum, infeasibility or unboundedness.
"""

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import tomli_w

from camopt.cam.families.free import free_cam
from camopt.cam.families.shape_rows import LinearisationPoint
from camopt.highs import Infeasible, Unbounded
from camopt.optimizer.program.kinematic import area_ratio_row, first_working, spline_rows, with_lift_reached
from camopt.optimizer.program.linear_program import Rows, WarmModel, maximise
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.scene import InputError, Scene, build_train, parse_scene
from experiments.architectures import ARCHITECTURES, train
from experiments.random_scenes import between
from experiments.support.record import RESULTS, called, run_script, write_result

PROGRAMS = {"small": 20, "full": 2000}
PER_SCENE = 10
"""Programs of a scene: five for each number of knots."""
KNOTS_PER_DURATION = 24, 48
MARGINS_N = -300.0, 100.0
KINDS = ("largest area", "without jump", "short of margins")
UNDECIDED = "undecided"


@dataclass(frozen=True)
class Posed:
    """A linear program as `maximise` takes it."""

    kind: str
    objective: np.ndarray
    rows: Rows
    bound: np.ndarray
    working: np.ndarray


def drawn(number: int) -> Scene:
    """The scene of a number; raises InputError where its numbers contradict each other before any program."""
    rng = np.random.default_rng([34, number])
    data = train(rng, ARCHITECTURES[number % len(ARCHITECTURES)])
    high = between(rng, (500.0, 12_000.0))
    speeds = [high * float(rng.uniform(0.3, 0.8)), high]
    data["operation"] = {"speeds_rpm": speeds, "band_rpm": speeds, "cam_per_crank": float(rng.choice([0.5, 1.0]))}
    data["design"] = design(rng)
    if rng.random() < 0.4:
        lift = data["design"]["max_lift_mm"]
        data["geometry"] = {"follower": "flat", "base_radius_mm": float(lift * rng.uniform(1.2, 3.0)),
                            "face_width_mm": float(lift * rng.uniform(2.0, 5.0)), "contact_width_mm": 10.0}  # fmt: skip
        data["design"]["nose_radius_min_mm"] = float(lift * rng.uniform(0.1, 0.5))
    return parse_scene(tomli_w.dumps(data | {"name": f"drawn-{number}"}), f"drawn {number}")


def design(rng: np.random.Generator) -> dict:
    """Conditions and limits; the limits on derivatives are multiples of lift / (half the duration)^order."""
    lift = between(rng, (1.0, 60.0)) if rng.random() < 0.5 else float(rng.uniform(6.0, 12.0))
    duration = float(rng.integers(80, 240)) if rng.random() < 0.5 else float(rng.integers(120, 170))
    height, half = max(0.27, float(rng.uniform(0.02, 0.04)) * lift), duration / 2
    data = {
        "duration_deg": duration,
        "max_lift_mm": lift,
        "reach_max_lift": bool(rng.random() < 0.4),
        "ramp_height_mm": height,
        "ramp_velocity_mm_per_deg": height / float(rng.uniform(12.0, 30.0)),
        "ramp_foot_deg": float(rng.choice([0.0, 10.0])),
        "acceleration_max_mm_per_deg2": lift / half**2 * between(rng, (4.0, 40.0)),
        "acceleration_min_mm_per_deg2": -lift / half**2 * between(rng, (2.0, 12.0)),
    }
    others = {
        "jerk_max_mm_per_deg3": (0.8, lift / half**3 * between(rng, (15.0, 400.0))),
        "snap_max_mm_per_deg4": (0.2, lift / half**4 * between(rng, (200.0, 9000.0))),
        "nose_deg": (0.3, duration * float(rng.uniform(0.05, 0.25))),
        "closing_ramp_velocity_mm_per_deg": (0.3, data["ramp_velocity_mm_per_deg"] * float(rng.uniform(0.7, 1.0))),
        "lift_at": (0.15, [[float(rng.uniform(-0.3, 0.3) * duration), 0.0, float(rng.uniform(0.3, 0.9) * lift)]]),
        "duration_at": (0.15, [[lift / 2, 0.3 * duration, float(rng.uniform(0.45, 0.7) * duration)]]),
        "contact_force_max_N": (0.3, between(rng, (800.0, 4000.0))),
    }
    return data | {key: value for key, (share, value) in others.items() if rng.random() < share}


def programs(number: int) -> Iterator[Posed]:
    """The programs of a scene; those that differ in right-hand sides only share their rows, and so a basis."""
    scene, rng = drawn(number), np.random.default_rng([35, number])
    design = scene.required_design
    speeds = [scene.cam_speed(speed) for speed in scene.required_operation.speeds_rpm]
    for knots in KNOTS_PER_DURATION:
        cam = free_cam(design, design.duration_deg / knots)
        cam = replace(cam, about=LinearisationPoint((0.0,) * len(design.duration_at)))
        row, _ = area_ratio_row(design, cam)
        limits = cam.limits(design)
        matrix, bound = with_lift_reached(cam, design, limits.matrix, limits.bound)
        reached = np.arange(len(limits.bound), len(bound))
        yield Posed(KINDS[0], row, spline_rows(matrix), bound, np.append(first_working(limits), reached))
        program = no_jump_program(build_train(scene), design, cam, speeds)
        margins = 20.0, *rng.uniform(*MARGINS_N, 2)
        posed = [program.relaxable(margin_N) for margin_N in margins]
        rows, *_, working = posed[0]
        for _, bound, *_ in posed:
            yield Posed(KINDS[1], row, rows, bound, working)
        elastic = program.elastic(margins[-1])
        yield Posed(KINDS[2], elastic.objective, elastic.rows, np.append(elastic.bound, 0.0), elastic.working)


class FreeInSign(WarmModel):
    """A model whose columns are free from the beginning."""

    def within(self, reach: float) -> None:
        super().within(np.inf)


def outcomes(number: int) -> dict:
    """Outcomes of the programs of a scene; empty where its numbers contradict each other before any program."""
    free: dict[str, Rows] = {}
    try:
        return {"programs": [solved(posed, free) for posed in programs(number)]}
    except InputError:
        return {"programs": []}


def solved(posed: Posed, free: dict[str, Rows]) -> dict:
    """Outcome of a program as camopt solves it, and with free columns, whose rows are kept in `free`."""
    outcome: dict = {"kind": posed.kind, "rows": len(posed.bound), "columns": len(posed.objective)}
    if free.get("of") is not posed.rows:
        free |= {"of": posed.rows, "rows": Rows(posed.rows.matrix, posed.rows.column)}
        vars(free["rows"])["model"] = FreeInSign(posed.rows.scaled)
    for way, rows in (("boxed", posed.rows), ("free", free["rows"])):
        begun = time.process_time()
        outcome[way] = decided(posed, rows)
        outcome[f"{way}_seconds"] = time.process_time() - begun
    return outcome


def decided(posed: Posed, rows: Rows) -> str:
    """Outcome of a program; where its first working set leaves it unbounded, all rows are used."""
    try:
        try:
            maximise(posed.objective, rows, posed.bound, posed.working)
        except Unbounded:
            rows.model.add(np.arange(len(posed.bound)), posed.bound / rows.norm)
            maximise(posed.objective, rows, posed.bound, posed.working)
    except Infeasible:
        return "infeasible"
    except Unbounded:
        return "unbounded"
    except ArithmeticError:
        return UNDECIDED
    return "optimal"


def main(size: str, folder=RESULTS) -> dict:
    """Draws, solves, counts, prints and writes `linear_programs.json`."""
    most, rows, first = PROGRAMS[size], [], 0
    while len(rows) < most:
        count = max(1, (most - len(rows)) // PER_SCENE)
        scenes = called(
            "experiments.linear_programs:outcomes", ({"number": n} for n in range(first, first + count)), size
        )
        rows += [row for scene in scenes for row in scene["programs"]]
        first += count
    rows = rows[:most]
    content = {"scenes": first, "programs": len(rows), "kinds": {kind: counted(rows, kind) for kind in KINDS}}
    content["all"] = counted(rows)
    return write_result("linear_programs", size, content, {}, folder)


def counted(rows: list[dict], kind: str | None = None) -> dict:
    """Numbers of programs of a kind, or of all, by outcome, and their processor times [s]."""
    rows = [row for row in rows if kind in (None, row["kind"])]
    ways = ("free", "boxed")
    outcomes: dict = {way: dict(Counter(row[way] for row in rows)) for way in ways}
    outcomes |= {f"{way}_undecided": outcomes[way].get(UNDECIDED, 0) for way in ways}
    seconds = {f"{way}_seconds": sum(row[f"{way}_seconds"] for row in rows) for way in ways}
    longest = {f"{way}_longest": max((row[f"{way}_seconds"] for row in rows), default=0.0) for way in ways}
    return {"programs": len(rows), **outcomes, **seconds, **longest}


if __name__ == "__main__":
    run_script(main, __doc__)
