"""What do a motion and its gradient cost when many trains or cams are simulated as one batch?

Randomly varied trains of `kodama`, each at five speeds, and many cams at many speeds are simulated as one batch of the
tied motion in double and in single precision: one revolution, and its gradient by the lift. The program is the same on
a processor and on an accelerator; JAX uses an accelerator if it finds one, and the result names the device. Each time
is the smaller of two measurements, per train or cam and per speed: the time by the clock, and the processor time of all
threads, which does not include other work of the machine.
"""

from collections.abc import Callable
from functools import cache, partial
from itertools import product
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import camopt
from camopt.measure.as_built import trains_as_built
from camopt.optimizer.stage_clock import peak_memory_mb
from camopt.smooth.laws import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import STEPS, WIDTH, parts_of_steps, tied_paths, tied_system
from experiments.gradient_batch import timed
from experiments.support.panels import Panel, panels
from experiments.support.record import RESULTS, printed, run_script, write_result

TRAINS = {"small": (2,), "full": (1, 4, 16, 64, 256, 1000)}
CAMS = {"small": ((2, 2),), "full": ((1, 16), (64, 16))}
"""(number of cams, number of speeds) of each batch of cams in the train as designed."""
LEFT_OUT = {"small": 1, "full": 0}
"""Number of batches skipped at the end: many cams in single precision compile nothing new."""
BAND_RPM = (5000, 7000)
SPEEDS = 5
"""Speeds over the band at which each drawn train runs."""
PRECISIONS = {"float64": jnp.float64, "float32": jnp.float32}
HEIGHT = 1e-3
"""Relative difference of the height of a cam of a batch from the next one."""
REPEATS = 2
CLOCKS = "ms", "processor_ms"
Batch = tuple[jax.Array, tuple, jax.Array, jax.Array]
"""Samples of the lift, systems, cam speeds, and states at rest; the first axis is that of trains or of cams."""


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Time [ms] and memory by precision and batch, and the largest error of the force in single precision [N]."""
    scene = camopt.load_scene("kodama")
    free = camopt.free_cam(scene.design, 6.0)
    cam = free.lift(np.zeros(free.Z.shape[1]))
    built = [one.train for one in trains_as_built(scene, max(TRAINS[size]), seed=1)]
    slowest = scene.cam_speed(BAND_RPM[0])
    parts = max(parts_of_steps(tied_system(one), slowest) for one in built)
    sizes = [(trains, 1, SPEEDS) for trains in TRAINS[size]] + [(1, *cams) for cams in CAMS[size]]
    batches = [(precision, *one) for precision in PRECISIONS for one in sizes]
    rows, forces = [], {}
    for precision, trains, cams, count in batches[: -LEFT_OUT[size] or None]:
        speeds = scene.cam_speed(1.0) * np.linspace(*BAND_RPM, count)
        samples = np.stack([(1.0 - HEIGHT * k) * lift_samples(cam, STEPS) for k in range(cams)])
        batch = as_batch(precision, built[:trains], samples, speeds)
        motion, slope = programs(cam.half_duration, parts, by_train=cams == 1)
        programs_of = {"motion": motion, "gradient": slope}
        both = {work: timed(partial(run, *batch), REPEATS)[0] for work, run in programs_of.items()}
        cases = trains * cams * count
        by_case = {f"{work}_{CLOCKS[i]}": 1e3 * t[i] / cases for work, t in both.items() for i in range(2)}
        row = {"precision": precision, "trains": trains, "cams": cams, "speeds": count}
        rows.append(printed(row | by_case | {"memory_MB": peak_memory_mb()}))
        forces[precision, trains, cams] = np.asarray(motion(*batch), float)
    pairs = [(forces["float64", *case], force) for (kind, *case), force in forces.items() if kind == "float32"]
    error = max(float(np.abs(double - single).max()) for double, single in pairs)
    content = {"device": jax.default_backend(), "float32_error_N": error, "rows": rows}
    return write_result("batch_scaling", size, content, {"time": figure(rows)}, folder)


def figure(rows: list[dict]) -> Figure:
    """Processor time of a motion and of its gradient, per train and speed, against the number of trains in a batch."""
    curves = []
    for work, precision in product(("motion", "gradient"), PRECISIONS):
        of = [row for row in rows if row["precision"] == precision and row["cams"] == 1 and row["speeds"] == SPEEDS]
        times = [row[f"{work}_processor_ms"] for row in of]
        curves.append((f"{work}, {precision}", [row["trains"] for row in of], times))
    xlabel, log = f"trains in a batch, at {SPEEDS} speeds each", ("log", "log")
    return panels([[Panel("time per train and speed [ms]", curves)]], xlabel, None, 6.4, 2.7, scale=log, marker="o")


def as_batch(precision: str, trains: list, samples: np.ndarray, speeds: np.ndarray) -> Batch:
    """Many trains with one cam, or many cams in one train, as arrays of a precision."""
    dtype = PRECISIONS[precision]
    systems = [tied_system(one) for one in trains]
    rests = [np.repeat(np.asarray(rest_state(one))[:, :, None], len(speeds), axis=2) for one in trains]
    system = jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves), dtype), *systems)
    rest = jnp.asarray(np.stack(rests), dtype)
    if len(samples) == 1:
        return jnp.asarray(samples[0], dtype), system, jnp.asarray(speeds, dtype), rest
    one = jax.tree.map(lambda leaf: leaf[0], system)
    return jnp.asarray(samples, dtype), one, jnp.asarray(speeds, dtype), rest[0]


@cache
def programs(half_duration: float, parts: int, by_train: bool) -> tuple[Callable, Callable]:
    """Forces of a batch, and the gradient of their sum by the samples of the lift, compiled."""
    axes = (None, 0, None, 0) if by_train else (0, None, None, None)

    def paths(samples, system, speeds, start, adjoint="forward"):
        event, tie, width = (jnp.asarray(q, samples.dtype) for q in (half_duration, 1.0, WIDTH))
        layer = Layer(width)
        moved = tied_paths(system, samples, speeds, start, (-event, event), tie, layer, parts=parts, adjoint=adjoint)
        return moved.force

    def total(*batch):
        return jnp.sum(jax.vmap(partial(paths, adjoint="reverse"), axes)(*batch))

    return jax.jit(jax.vmap(paths, axes)), jax.jit(jax.grad(total))


if __name__ == "__main__":
    run_script(main, __doc__)
