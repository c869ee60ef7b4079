# %% [markdown]
# # First design
#
# From a scene to a cam that independent methods confirm. Open this file as a notebook (JupyterLab with jupytext, VS
# Code and Spyder read the percent format) or run it as a script: `python notebooks/first_design.py`. The size `small`,
# as in `CAMOPT_NOTEBOOK_SIZE=small`, takes the one-mass train and seconds; the full size designs for the train of ten
# masses and takes minutes.

# %%
import os

import camopt
from camopt.report import write_report

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")

# %% [markdown]
# The scene asks for limits on the shape, limits on the motion, and the speeds at which they must hold.

# %%
scene.design.model_dump(exclude_none=True)

# %% [markdown]
# How much area can any cam have within these limits? The bound comes from weak duality: no cam exceeds it, spline or
# not. `worth_percent` says what 1 % more of each limit would buy.

# %%
camopt.area_bound(scene, knot_deg=4.0 if SMALL else 2.0)

# %% [markdown]
# The design comes in stages: a linear program over the periodic response finds the region, gradients go on from there,
# and only cams that event-exact simulation confirms count. `gradient="none"` leaves the gradients out, which saves
# JAX's compilation.

# %%
run = camopt.optimize(
    scene,
    speeds="nominal" if SMALL else "band",
    accuracy="draft" if SMALL else "standard",
    gradient="none" if SMALL else "smooth",
)
run

# %% [markdown]
# The figures show the cam with the scene's limits drawn, and its bounce and jump against speed.

# %%
run.lift.plot(scene.design)

# %%
run.plot()

# %% [markdown]
# The run folder holds the lift table for whoever grinds the cam, every figure, and a report that opens offline.

# %%
print(write_report(run.folder))
print(sorted(path.name for path in run.folder.iterdir()))

# %% [markdown]
# The same from a terminal: `camopt optimize kodama`. Any stage reads the folder back as a cam:
# `camopt verify kodama --cam runs/...`.

# %%
again = camopt.read_cam(run.folder, scene)
again
