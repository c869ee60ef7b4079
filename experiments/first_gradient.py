"""How long does it take from the start of `python` to the first gradient, in the first process and in the next one?

Each process starts with nothing loaded and ends with a gradient; the first has an empty folder for compiled programs,
the second has the programs that the first stored there. Two gradients are measured: that of a Lagrangian by the
coefficients of a free cam, through the tied motion at nine speeds of the band from its settled start, as `ascend` with
path constraints takes it; and that of the seating velocity by the gaps, through `simulate(method="smooth")`. Processor
time is that of all threads of a process; the time by the clock includes other work of the machine.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from experiments.support.record import RESULTS, printed, run_script, write_result

ROOT = Path(__file__).parents[1]
SCENES = {"small": ("motori-1",), "full": ("kodama", "motori-1", "pushrod-hydraulic")}
PROCESSES = ("first", "second")
PATHS = """
import camopt, jax, numpy as np
scene = camopt.load_scene({scene!r})
free = camopt.free_cam(scene.design, 3.0)
cam = free.lift(np.zeros(free.Z.shape[1]))
limits = {{"contact_force_N": 0.0, "seat_gap_mm": 0.03}}
value = camopt.objective(scene, constraints=limits, source="smooth").of(cam)
from camopt.optimizer.ascent.lagrangian import PathLagrangian
lagrangian = PathLagrangian(value)
held = lagrangian.begin(value.parameters, cam)
slope = jax.jit(jax.grad(lambda own: lagrangian(value(own), own, held)[0]))
assert np.all(np.isfinite(slope(value.parameters)["z"]))
"""
MOTION = """
import camopt, jax, numpy as np
from camopt.study.simulate.motion import motion_parameters
scene = camopt.load_scene({scene!r})
cam = camopt.polydyne(scene, design_speed_rpm=max(scene.operation.speeds_rpm))
speed, gap = scene.operation.speeds_rpm[0], motion_parameters(scene, cam)["gap"]
def seating(gap):
    motion = camopt.simulate(scene, cam, speed, "smooth", parameters={{"gap": gap}})
    return motion["seating_velocity_m_per_s"].data[0]
assert np.all(np.isfinite(jax.grad(seating)(gap)))
"""
GRADIENTS = {"path constraints": PATHS, "motion": MOTION}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Clock and processor time [s] by gradient, scene and process, and the number of compilation notices."""
    rows = []
    for gradient, script in GRADIENTS.items() if size == "full" else [("path constraints", PATHS)]:
        for scene in SCENES[size]:
            with tempfile.TemporaryDirectory() as cache:
                for process in PROCESSES:
                    times = timed(script.format(scene=scene), cache)
                    rows.append(printed({"gradient": gradient, "scene": scene, "process": process, **times}))
    return write_result("first_gradient", size, {"rows": rows}, {}, folder)


def timed(script: str, cache: str) -> dict:
    """Times of a process with a folder of compiled programs, and the number of its compilation notices."""
    environment = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env=environment | {"XDG_CACHE_HOME": cache},
        stderr=subprocess.PIPE,
        text=True,
    )
    clock, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(done.stderr)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    notices = done.stderr.count("JAX compiles a program")
    return {"clock_s": round(clock, 2), "processor_s": round(processor, 2), "lines": notices}


if __name__ == "__main__":
    run_script(main, __doc__)
