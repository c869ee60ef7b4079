"""Compiled programs are kept, and one that takes long to compile says so."""

import os
import subprocess
import sys
import time

import jax
import jax.monitoring
import jax.numpy as jnp
import pytest

import camopt
import camopt.smooth as smooth
from camopt.scene.train import build_train
from camopt.smooth.laws import Layer
from camopt.smooth.rest import rest_state
from camopt.smooth.simulate import lift_samples
from camopt.smooth.tied import STEPS, WIDTH, parts_of_steps, tied_paths, tied_system


@pytest.mark.parametrize(("wait", "lines"), [(0.3, 1), (0.0, 0)])
def test_a_line_says_what_takes_long(wait, lines, monkeypatch, capsys):
    monkeypatch.setattr(smooth, "LONG_S", 0.1)
    jax.monitoring.record_event_duration_secs("/jax/core/compile/jaxpr_to_mlir_module_duration", 0.0)
    time.sleep(wait)
    jax.monitoring.record_event_duration_secs("/jax/core/compile/backend_compile_duration", wait)
    time.sleep(0.15)
    assert capsys.readouterr().err.count("camopt: JAX compiles a program, ") == lines


@pytest.mark.parametrize("name", ["motori-1", "pushrod-hydraulic"])
def test_the_tied_motion_and_its_gradient_have_no_host_callback(name):
    """JAX keeps no program on disk that calls back to the host."""
    scene = camopt.load_scene(name)
    train, cam = build_train(scene), camopt.polydyne(scene, ramp_height_mm=scene.design.ramp_height_mm)
    tied, speed = tied_system(train), scene.cam_speed(scene.operation.speeds_rpm[0])
    samples, start = jnp.asarray(lift_samples(cam, STEPS)), rest_state(train)[:, :, None]
    parts, half = parts_of_steps(tied, speed), cam.half_duration

    def total(samples):
        at = jnp.asarray([speed]), start, (-half, half), 1.0, Layer(WIDTH)
        return jnp.sum(tied_paths(tied, samples, *at, parts=parts, adjoint="reverse").force)

    text = jax.jit(jax.grad(total)).lower(samples).as_text()
    assert "while" in text and "callback" not in text


PROCESS = """
import diffrax, jax, jax.monitoring
import camopt, numpy as np
counts = {"compile_requests_use_cache": 0, "cache_hits": 0}
def listen(event, **_):
    for name in counts:
        counts[name] += event == f"/jax/compilation_cache/{name}"
jax.monitoring.register_event_listener(listen)
scene = camopt.load_scene("motori-1")
free = camopt.free_cam(scene.design, 6.0)
cam = free.lift(np.zeros(free.Z.shape[1]))
value = camopt.objective(scene, constraints={"contact_force_N": 0.0}, source="smooth").of(cam)
from camopt.optimizer.ascent.lagrangian import PathLagrangian
lagrangian = PathLagrangian(value)
held = lagrangian.begin(value.parameters, cam)
jax.jit(jax.grad(lambda own: lagrangian(value(own), own, held)[0]))(value.parameters)
print(*counts.values())
"""


def test_programs_are_kept_where_diffrax_was_imported_before():
    """equinox then has its checks as callbacks, and JAX keeps no program that has one. Where no earlier run has left
    them in the user's cache, a first process does."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("JAX_", "EQX_"))}
    for _ in range(2):
        words = [sys.executable, "-c", PROCESS]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
        asked, hits = map(int, done.stdout.split())
        if hits == asked:
            break
    assert hits == asked > 0


def test_a_folder_that_jax_has_is_left_to_it(tmp_path):
    before = jax.config.values["jax_compilation_cache_dir"]
    try:
        jax.config.update("jax_compilation_cache_dir", str(tmp_path))
        assert smooth.cache_compilations() == tmp_path
        assert jax.config.values["jax_compilation_cache_dir"] == str(tmp_path)
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
