"""What does a motion cost, and its gradient, when many trains run side by side in one program?

    python -m experiments.batch_scaling [small|full]

Drawn trains of `kodama`, each at five speeds, as one batch of the tied motion in double and in single precision: one
revolution, and its gradient by the lift. The program is the same on a processor and on an accelerator; JAX takes the
latter where it finds one, and the result says which it was. Times are the least of five, per train and speed: by the
clock, and of the processor's threads together, beside which other work does not count.
"""

import resource
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import camopt
from camopt.measure.as_built import trains_as_built
from camopt.smooth.contact import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import STEPS, WIDTH, parts_of_steps, tied_paths, tied_system
from experiments.support.record import RESULTS, run_script, write_result

COUNTS = {"small": (1, 4), "full": (1, 4, 16, 64)}
SPEEDS_RPM = (5000, 5500, 6000, 6500, 7000)
PRECISIONS = {"float64": jnp.float64, "float32": jnp.float32}
REPEATS = 5


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """By precision and number of trains the milliseconds and the memory, and how far single precision is off [N]."""
    scene = camopt.load_scene("kodama")
    lift = camopt.free_cam(scene.design, 6.0)
    cam = lift.lift(np.zeros(lift.Z.shape[1]))
    built = trains_as_built(scene, max(COUNTS[size]), seed=1)
    speeds = np.array([scene.cam_speed(rpm) for rpm in SPEEDS_RPM])
    systems = [tied_system(one.train) for one in built]
    rests = [np.repeat(np.asarray(rest_state(one.train))[:, :, None], len(speeds), axis=2) for one in built]
    parts, half = max(parts_of_steps(one, float(speeds.min())) for one in systems), cam.half_duration
    rows, forces = [], {}
    for precision, dtype in PRECISIONS.items():
        samples = jnp.asarray(lift_samples(cam, STEPS), dtype)
        event, layer = (jnp.asarray(-half, dtype), jnp.asarray(half, dtype)), Layer(jnp.asarray(WIDTH, dtype))
        tie, at = jnp.asarray(1.0, dtype), jnp.asarray(speeds, dtype)

        def paths(samples, system, start, event=event, layer=layer, tie=tie, at=at, adjoint="forward"):
            return tied_paths(system, samples, at, start, event, tie, layer, parts=parts, adjoint=adjoint).force

        def total(samples, systems, starts, paths=paths):
            return jnp.sum(jax.vmap(partial(paths, adjoint="reverse"), (None, 0, 0))(samples, systems, starts))

        motion, slope = jax.jit(jax.vmap(paths, (None, 0, 0))), jax.jit(jax.grad(total))
        for count in COUNTS[size]:
            batch = jax.tree.map(lambda *q, dtype=dtype: jnp.asarray(np.stack(q), dtype), *systems[:count])
            starts = jnp.asarray(np.stack(rests[:count]), dtype)
            cases = count * len(speeds)
            times = {"motion": least(motion, samples, batch, starts), "gradient": least(slope, samples, batch, starts)}
            by_case = {f"{work}_{name}": 1e3 * t / cases for work, kinds in times.items() for name, t in kinds.items()}
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
            rows.append({"precision": precision, "trains": count, **by_case, "memory_MB": memory})
            print(rows[-1], flush=True)
        forces[precision] = np.asarray(motion(samples, batch, starts), float)
    error = np.abs(forces["float32"] - forces["float64"]).max()
    content = {"device": jax.default_backend(), "speeds_rpm": SPEEDS_RPM, "float32_error_N": float(error), "rows": rows}
    write_result("batch_scaling", size, content, {}, folder)
    return content


def least(run: Callable, *arguments) -> dict[str, float]:
    """Least times of a call [s] by the clock and of the processor, after one that compiles."""
    jax.block_until_ready(run(*arguments))
    clocks = {"ms": time.perf_counter, "processor_ms": time.process_time}
    times = {name: np.inf for name in clocks}
    for _ in range(REPEATS):
        begun = {name: clock() for name, clock in clocks.items()}
        jax.block_until_ready(run(*arguments))
        times = {name: min(times[name], clock() - begun[name]) for name, clock in clocks.items()}
    return times


if __name__ == "__main__":
    run_script(main, __doc__)
