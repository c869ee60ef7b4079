# %% [markdown]
# # An experiment of your own
#
# An experiment needs a number to maximise, a cam to start from, an optimiser, and a judge: twenty lines. Here the
# forces between cam and valve must stay positive, and two optimisers start from the calmest cam.

# %%
import os

import jax
import matplotlib.pyplot as plt
import optax
import pandas

import camopt

SMALL = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full") == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")

# %% [markdown]
# The objective is the area. Its constraints apply at every angle and speed of the smoothed motion with tied contacts:
# [width, tie, steps and source](../docs/how-to/smoothing.md) explains these terms.

# %%
objective = camopt.objective(
    scene,
    constraints={"contact_force_N": 0.0, "seat_gap_mm": 0.03},
    source="smooth",
    speeds_rpm=(5000, 6000) if SMALL else None,
)

# %% [markdown]
# Two optimisers of [optax](https://optax.readthedocs.io), from the same start. With `metric=True` a step of length one
# changes the forces by one unit, independent of the scale of the coefficients. Event-exact judges the last cams.

# %%
steps = 12 if SMALL else 90
climbs = {
    name: camopt.ascend(objective, "calmest", optimiser, steps, knot_deg=6.0, metric=True, judge_every=steps)
    for name, optimiser in {"Adam": optax.adam(0.02), "L-BFGS": optax.lbfgs()}.items()
}
shown = ("area_ratio", "contact_force_N", "largest_share")
pandas.DataFrame({name: {key: float(climb.dataset[key][-1]) for key in shown} for name, climb in climbs.items()})

# %% [markdown]
# The figure shows both optimisations. A slightly negative force does not matter: the judge decides.

# %%
figure, (area, force) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
for name, climb in climbs.items():
    climb.dataset.area_ratio.plot(ax=area, label=name)
    climb.dataset.contact_force_N.plot(ax=force, label=name)
area.set_title("area ratio")
force.set_title("least contact force [N]")
area.legend()
plt.close(figure)  # its last line shows it, once
figure

# %% [markdown]
# A loop of your own only needs the value and its gradient. One compiled program computes both; JAX stores it on disk.

# %%
cam = climbs["L-BFGS"].best or climbs["L-BFGS"].nearest
value = camopt.objective(scene, speeds_rpm=(5000,), maximise="dynamic_area_mm_deg", source="exact").of(cam)
step = jax.value_and_grad(value)(value.parameters)
f"dynamic area {float(step[0]):.1f} mm deg, length of its gradient {float(abs(step[1]['z']).max()):.3g}"
