# %% [markdown]
# # Robust band and Pareto front
#
# A design for four speeds may bounce a few percent away from them, a cam is ground with errors, and springs sag. Three
# questions: where in the band is a cam worst, what does it do when something is off, and what does a limit cost?

# %%
import os

import numpy as np
import pandas

import camopt
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.robust import perturbations

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")
low, high = scene.operation.band_rpm

# %% [markdown]
# The largest area within the bounce limit, for several values of that limit: each point is a cam that the event-exact
# judge confirms at the speeds asked. A crossed point means that no cam was found.

# %%
front = camopt.pareto(
    scene, "bounce_max_mm", values=(0.05,) if SMALL else (0.01, 0.05, 0.2), speeds="nominal" if SMALL else "band"
)
front

# %%
front.plot()

# %% [markdown]
# A cam over the whole band: the search's judge settles the event-exact motion at every speed.

# %%
cam = camopt.polydyne(scene, design_speed_rpm=low)
judge = Judge(scene, np.linspace(low, high, 5 if SMALL else 41))
nominal = judge(cam)
print(f"worst at {nominal.worst_speed_rpm:.0f} r/min: bounce up to {nominal.worst('bounce_mm'):.4f} mm")

# %% [markdown]
# The same cam with the spring's rate and preload, the contacts' stiffness and the lash off, one at a time and both
# ways, and with grinding errors of 5 um.

# %%
rows = []
for name, off in perturbations(scene, seeds=1 if SMALL else 5).items():
    judged = Judge(off.scene, judge.speeds_rpm[:: 1 if SMALL else 4])(off.applied(cam))
    rows.append({"off": name, **{f"worst {metric}": judged.worst(metric) for metric in judged.figures}})
pandas.DataFrame(rows)

# %% [markdown]
# To design against all of it, `camopt.optimizer.search.search.find_cam(..., perturbations=perturbations(scene))` asks
# that the limits hold under each. Every verdict sweeps the band too: `verify` looks for its worst speeds and lets every
# method judge there.

# %%
verdict = camopt.verify(scene, cam, (low,) if SMALL else None, accuracy="draft")
verdict

# %%
verdict.plot()
