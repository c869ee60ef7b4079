# %% [markdown]
# # Trust in gradients
#
# A gradient through contacts can be right, or it can agree with its own model and be wrong for the train. Here the
# seating velocity is differentiated with respect to the cam's coefficients along two paths, and both gradients are
# compared with central differences of the exact motion.

# %%
import os
from dataclasses import replace

import jax
import matplotlib.pyplot as plt
import numpy as np

import camopt
from camopt.exact.adjoint.motion import value_and_gradient
from camopt.scene import build_train
from camopt.study.simulate.motion import motion_parameters

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")
cam = camopt.polydyne(scene)
speed_rpm = 5000.0
METRIC = "seating_velocity_m_per_s"
# the small size compiles quickly rather than well
COMPILER = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True} if SMALL else {}

# %% [markdown]
# The cam is changed in one direction: all coefficients in proportion, that is, a larger lift everywhere. `value(s)` is
# the metric of the exact motion with the lift (1 + s) times as large.

# %%
train, cam_speed = build_train(scene), scene.cam_speed(speed_rpm)
direction = cam.coefficients


def value(s: float) -> float:
    """Seating velocity [m/s] with the cam's lift (1 + s) times as large."""
    moved = replace(cam, coefficients=cam.coefficients + s * direction)
    return float(value_and_gradient(train, moved, cam_speed, [METRIC], revolutions=2).values[0])


# %% [markdown]
# Central differences are computed for a range of steps. At small steps round-off dominates, at large steps curvature.
# Where the differences agree over several decades, the derivative is well defined.

# %%
steps = 10.0 ** np.arange(-7, -2.9, 0.5)
differences = np.array([(value(h) - value(-h)) / (2 * h) for h in steps])

# %% [markdown]
# The exact gradient is that of the discrete adjoint of event-exact motion, which jumps where a contact opens or closes.

# %%
exact = value_and_gradient(train, cam, cam_speed, [METRIC], revolutions=2)
by_adjoint = float(np.sum(exact.by_coefficients[0] * direction))
print(f"seating velocity {exact.values[0]:.6f} m/s, slope {by_adjoint:.9f} (adjoint)")
print(f"central differences {differences.min():.9f} to {differences.max():.9f}")

# %% [markdown]
# On the smooth path the contact law is smoothed within a thin layer, and JAX differentiates the time stepping. JAX can
# differentiate `simulate` with respect to the cam's pieces, masses, stiffnesses, dampings, preloads, gaps and speed.

# %%
lift = motion_parameters(scene, cam)["lift"]


def seating_velocity(s):
    """The metric along the smooth path, last measured revolution."""
    motion = camopt.simulate(
        scene, cam, speed_rpm, method="smooth", step_deg=5.0, parameters={"lift": lift + s * direction}
    )
    return motion[METRIC].data[-1]


smooth_value, by_smooth = jax.jit(jax.value_and_grad(seating_velocity), compiler_options=COMPILER)(0.0)
print(f"seating velocity {float(smooth_value):.6f} m/s, slope {float(by_smooth):.9f} (smooth)")

# %%
figure, axes = plt.subplots(figsize=(6.5, 3.4), layout="constrained")
axes.semilogx(steps, differences, "o-", label="central differences of event-exact")
axes.axhline(by_adjoint, color="#0072B2", label="exact gradient")
axes.axhline(float(by_smooth), color="#D55E00", linestyle="--", label="smooth gradient")
axes.set(xlabel="step, relative to the lift [-]", ylabel="slope of the seating velocity [m/s]")
axes.legend()
plt.close(figure)
figure

# %% [markdown]
# A gradient should not be trusted at a grazing contact, where it is one-sided, and beyond the onset of jump, where the
# motion becomes chaotic within a revolution or two. The gradient reports its distance to the next grazing.

# %%
print(exact.grazing)

# %%
assert np.isclose(by_adjoint, differences[len(steps) // 2], rtol=1e-4)
assert np.isclose(by_adjoint, float(by_smooth), rtol=1e-2)
