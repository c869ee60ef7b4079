"""How does the computing time of a revolution grow with the numbers of masses and contacts, and what does a one-mass
model save?

The train is `kodama`, with its spring divided more finely for more masses, and reduced as by `camopt reduce` for fewer.
Measured is the first revolution from rest with the plain Polydyne, with fixed-step methods at the step that the highest
natural frequency requires. Times are processor times, or times by the clock for JAX programs.
"""

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.families.polydyne import polydyne
from camopt.exact import engine
from camopt.plots.style import new_figure, styled
from camopt.scene import Scene, build_train, load_scene, parse_scene
from camopt.scene.rest import state_at_rest
from camopt.scene.text_file import scene_toml
from camopt.study.reduce.idle_contacts import LeftOut, leave_out
from camopt.study.reduce.reduced_models import smaller_models
from camopt.study.reduce.reduction import milliseconds, path_times
from camopt.verifier.convergence import first_steps
from camopt.verifier.methods import rkg, tmm
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.smooth_costs import smooth_times

SPEED_RPM = 6000.0
CHAIN = ((10, 5), (9, 5), (8, 5), (7, 5), (6, 5), (5, 4), (4, 3), (3, 2), (2, 1), (1, 0))
"""(masses, surge masses) of the reduced models: first the train is condensed, then the spring loses its modes."""
COILS = {"small": (10,), "full": (10, 20, 40)}
IDLE = {"small": (0, 1), "full": (0, 1, 2, 4, 8)}
SMOOTH_AT = {"small": (10, 1), "full": (45, 25, 15, 10, 5, 3, 1)}
CLASH = """
[[element]]
name = "clash_{0}"
kind = "contact"
between = ["{1}", "{2}"]
stiffness_N_per_m = 1e6
damping_N_s_per_m = 5.0
gap_mm = 14.0
"""


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `cost_scaling.json` and its figures."""
    scene = load_scene("kodama")
    cam = polydyne(scene)
    rows = [masses_row(s, cam, len(s.mass) in SMOOTH_AT[size]) for s in scenes_by_masses(scene, size)]
    content = {
        "speed_rpm": SPEED_RPM,
        "masses": rows,
        "one_against_ten": one_against_ten(rows),
        "masses_exponent": exponents(rows) if size == "full" else {},
        "contacts": (contacts := [masses_row(with_clashes(scene, n), cam) | {"idle_contacts": n} for n in IDLE[size]]),
        "never_closing": [never_closing(scene, cam), never_closing(load_scene("motori-1"), cam)],
    }
    return write_result("cost_scaling", size, content, figures(rows, contacts) if size == "full" else {}, folder)


def scenes_by_masses(scene: Scene, size: str) -> list[Scene]:
    """The scenes from the largest number of masses down to one."""
    models = {(len(m.scene.mass), m.surge_masses): m.scene for m in smaller_models(scene)}
    return [*(with_coils(scene, n) for n in reversed(COILS[size])), *(models[key] for key in CHAIN)]


def with_coils(scene: Scene, count: int) -> Scene:
    """The scene with its spring of five masses divided into `count` masses, of the same total mass and rate."""
    coils = [m for m in scene.mass if m.name.startswith("spring_")]
    names = [f"spring_{i}" for i in range(1, count + 1)]
    mass = tuple(coils[0].model_copy(update={"name": n, "mass_kg": coils[0].mass_kg * 5 / count}) for n in names)
    ends, ratio = ["valve_tip", *names, "ground"], (count + 1) / 6
    coil = next(e for e in scene.element if e.name == "coil_1")
    stiffness, damping = (coil.stiffness_N_per_m or 0.0) * ratio, coil.damping_N_s_per_m * ratio
    update = {"stiffness_N_per_m": stiffness, "damping_N_s_per_m": damping}
    springs = [
        coil.model_copy(update={"name": f"coil_{i}", "between": (ends[i - 1], ends[i]), **update})
        for i in range(1, count + 2)
    ]
    others = [e for e in scene.element if not e.name.startswith("coil_")]
    masses = tuple(m for m in scene.mass if m not in coils) + mass
    return parse_scene(
        scene_toml(scene.model_copy(update={"mass": masses, "element": (*others, *springs), "tolerance": ()})),
        scene.name,
    )


def masses_row(scene: Scene, cam, smooth: bool = False) -> dict:
    """Times of one scene by method [ms], with the numbers of steps and stops that explain them."""
    train, cam_speed = build_train(scene), scene.cam_speed(SPEED_RPM)
    ms = path_times(LeftOut(scene), train, cam, cam_speed)
    run = engine.prepare(train, cam, cam_speed)
    rest = state_at_rest(train)
    ms["event, end state"] = milliseconds(lambda: run.advance(rest), 20)
    if smooth:
        ms |= smooth_times(train, cam, cam_speed)
    response, samples = run(rest), int(run.period / run.step)
    return {
        "masses": len(scene.mass),
        "steps_per_revolution": first_steps(train, cam_speed),
        "event_steps": samples,
        "event_stops": len(response.angle) - samples,  # switchings twice, borders of the lift's pieces once
        "ms": ms,
    }


def one_against_ten(rows: list[dict]) -> dict:
    """Ratio of the one-mass scene to the ten-mass one by method: total time, number of steps, and time per step."""
    one, ten = (next(r for r in rows if r["masses"] == n) for n in (1, 10))
    steps = {p: "event_steps" if p.startswith("event") else "steps_per_revolution" for p in one["ms"]}
    ratios = {}
    for path in one["ms"]:
        time, count = one["ms"][path] / ten["ms"][path], one[steps[path]] / ten[steps[path]]
        ratios[path] = {"time": time, "steps": count, "per_step": time / count}
    return ratios | {"event_stops": {"one": one["event_stops"], "ten": ten["event_stops"]}}


def exponents(rows: list[dict]) -> dict[str, float]:
    """By method the exponent of the number of masses in the time."""
    return {p: exponent([(row["masses"], row["ms"][p]) for row in rows if p in row["ms"]]) for p in rows[0]["ms"]}


def exponent(points: list[tuple[int, float]]) -> float:
    """Slope of log time over log number of points (number, time), in the upper half of the logarithmic range."""
    logs = np.log(points)
    upper = logs[logs[:, 0] >= logs[:, 0].mean()]
    return float(np.polyfit(upper[:, 0], upper[:, 1], 1)[0]) if len(upper) > 1 else float("nan")


def with_clashes(scene: Scene, count: int) -> Scene:
    """The scene with `count` contacts that never close: between coils, or above the valve."""
    coils = [m.name for m in scene.mass if m.name.startswith("spring_")] or [scene.valve, "ground"]
    pairs = [(coils[i % (len(coils) - 1)], coils[i % (len(coils) - 1) + 1]) for i in range(count)]
    text = scene_toml(scene) + "".join(CLASH.format(i, *pair) for i, pair in enumerate(pairs, 1))
    return parse_scene(text, scene.name)


def never_closing(scene: Scene, cam, repeats: int = 40) -> dict:
    """A contact that never closes: kept, and left out but monitored, compared with the scene without it."""
    with_it = with_clashes(scene, 1)
    model = leave_out(with_it, frozenset({"clash_1"}), frozenset())
    cam_speed = scene.cam_speed(SPEED_RPM)
    whole, reduced = build_train(with_it), build_train(model.scene)
    rest, steps = state_at_rest(reduced), first_steps(reduced, cam_speed)
    methods = {
        "event": engine.prepare,
        "rkg": lambda train, cam, cam_speed: rkg.prepare(train, cam, cam_speed, steps),
        "tmm": lambda train, cam, cam_speed: tmm.prepare(train, cam, cam_speed, steps),
    }
    rows = {}
    for name, method in methods.items():
        kept, gone = method(whole, cam, cam_speed), method(reduced, cam, cam_speed)
        watched = model.prepare(method, reduced, cam, cam_speed)
        times = np.array(
            [[milliseconds(lambda r=r: r(rest), 1) for r in (kept, gone, watched)] for _ in range(repeats)]
        )
        kept_more, _, watched_more = np.median(times / times[:, 1:2], axis=0) - 1  # ratios of consecutive runs
        end = [r(rest).x[-1] for r in (kept, gone, watched)]
        rows[name] = {
            "ms_without": times[:, 1].min(),
            "kept": {"time": kept_more, "same_digits": bool(np.array_equal(end[0], end[1]))},
            "left_out": {"time": watched_more, "same_digits": bool(np.array_equal(end[2], end[1]))},
            "kept_largest_change_mm": float(np.abs(end[0] - end[1]).max() * 1e3),
        }
    return {"scene": scene.name, "more_time": rows}


LINES = {
    "event": ("event-exact, sampled", "#0072B2"),
    "event, end state": ("event-exact, end state", "#56B4E9"),
    "rkg": ("Runge-Kutta-Gill", "#D55E00"),
    "tmm": ("transition matrix", "#009E73"),
    "smooth": ("smooth scan", "#B0518E"),
    "batch": ("smooth batch, per motion", "#E69F00"),
}


@styled
def figures(masses: list[dict], contacts: list[dict]) -> dict[str, Figure]:
    """Time of a revolution against the number of masses, and the additional time of idle contacts."""
    drawing = new_figure(6.4, 3.6)
    axes = drawing.subplots(1, 2)
    _lines(axes[0], masses, "masses")
    none = contacts[0]["ms"]
    more = [row | {"ms": {p: 100 * (ms / none[p] - 1) for p, ms in row["ms"].items()}} for row in contacts]
    _lines(axes[1], more, "idle_contacts")
    axes[0].set(xscale="log", yscale="log", xlabel="masses", ylabel="time per revolution [ms]")
    axes[1].set(xlabel="contacts that never close", ylabel="more time [%]")
    handles, labels = axes[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper center", ncols=3)
    return {"time": drawing}


def _lines(axes, rows: list[dict], by: str) -> None:
    for path in dict.fromkeys(p for r in rows for p in r["ms"]):
        points = sorted((r[by], r["ms"][path]) for r in rows if path in r["ms"])
        label, colour = LINES[path]
        axes.plot(*zip(*points, strict=True), marker="o", markersize=3.5, color=colour, label=label)


if __name__ == "__main__":
    run_script(main, __doc__)
