"""What area does gradient ascent alone (`camopt.ascend`) reach on `motori-1` from a Polydyne, by which optimiser, and
in what time?

The start is the free cam nearest to the plain Polydyne within the limits (knots every 6 deg). The objective is the area
ratio less penalties on bounce and jump. On the exact path it is maximised by Adam at two rates, plain gradient steps
and L-BFGS, and on the smooth path by Adam with fewer steps. There are two problems: two speeds at which nothing
bounces, where the linear program gives the answer, and three at which the start exceeds its limits a hundredfold. Every
fifth step the settled motion is evaluated by event-exact, and the largest area ratio that it confirms is reported.
Processor time includes compilation. For comparison the result has the area that the limits on the shape alone allow,
and that of the linear program that keeps contact at these speeds.
"""

import time

import optax

import camopt
from camopt.cam.families.free import free_cam
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.optimizer.program.no_jump import no_jump_program
from camopt.scene import Scene, build_train, load_scene
from experiments.support.record import RESULTS, run_script, write_result

KNOT_DEG = 6.0
PROBLEMS = {"calm": (4000.0, 5000.0), "bouncing": (5000.0, 6000.0, 7000.0)}
PENALTIES = {"bounce_mm": 1.0, "jump_mm": 1.0}
OPTIMISERS = {
    "adam 1e-3": ("exact", optax.adam(1e-3), {"small": 10, "full": 150}),
    "adam 1e-4": ("exact", optax.adam(1e-4), {"small": 5, "full": 150}),
    "gradient 1e-4": ("exact", optax.sgd(1e-4), {"small": 5, "full": 150}),
    "l-bfgs": ("exact", optax.lbfgs(), {"small": 0, "full": 30}),
    "adam 1e-3, smooth": ("smooth", optax.adam(1e-3), {"small": 0, "full": 15}),
}
"""Path, optax transformation and number of steps; an optimiser without steps is left out."""
REVOLUTION = 1
"""The revolution whose metrics are penalised, as in the stored result."""


def bounds(scene: Scene, speeds_rpm: tuple[float, ...]) -> dict[str, float]:
    """Area ratios of the linear programs: under the limits on the shape, and with every contact kept as well."""
    design = scene.required_design
    cam, speeds = free_cam(design, KNOT_DEG), [scene.cam_speed(speed) for speed in speeds_rpm]
    program = no_jump_program(build_train(scene), design, cam, speeds)
    return {
        "area_ratio_of_the_shape": kinematic_optimum(design, cam).area_ratio,
        "area_ratio_no_jump": program.solve(0.0).area_ratio,
    }


def climbed(scene: Scene, speeds_rpm: tuple[float, ...], path: str, optimiser, steps: int) -> dict:
    """One ascent: its start, the confirmed area, and its processor time."""
    begin = time.process_time()
    objective = camopt.objective(scene, speeds_rpm=speeds_rpm, penalties=PENALTIES, path=path, revolutions=REVOLUTION)
    history = camopt.ascend(objective, camopt.polydyne(scene), optimiser, steps, knot_deg=KNOT_DEG)
    seconds, best = time.process_time() - begin, history.dataset.attrs.get("best", history.dataset.attrs["nearest"])
    return {
        "steps": steps,
        "share_at_the_start": float(history["largest_share"][0]),
        "area_ratio_at_the_start": float(history["area_ratio"][0]),
        "confirmed": history.confirmed,
        "best_step": best,
        "area_ratio": float(history["area_ratio"][best]) if history.confirmed else None,
        "largest_share": float(history["largest_share"][best]),
        "processor_s": seconds,
    }


def main(size: str, folder=RESULTS) -> dict:
    """Measures, prints and writes `gradient_ascent.json`."""
    scene, content = load_scene("motori-1"), {}
    for problem, speeds in PROBLEMS.items():
        content[problem] = {"speeds_rpm": speeds, **bounds(scene, speeds), "ascents": {}}
        print(problem, content[problem])
        for name, (path, optimiser, steps) in OPTIMISERS.items():
            if steps[size]:
                row = climbed(scene, speeds, path, optimiser, steps[size])
                content[problem]["ascents"][name] = row
                print(f"  {name}: {row}")
    return write_result("gradient_ascent", size, content, {}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
