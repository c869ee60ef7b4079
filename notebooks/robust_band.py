# %% [markdown]
# # Robust band and Pareto front
#
# A cam that is designed for four speeds may bounce at speeds a few per cent away from them, cams are ground with
# errors, and springs lose load. Three questions: At which speed of the band is a cam worst? How does it perform in
# trains as built? What does a limit cost?

# %%
import os

import matplotlib.pyplot as plt
import numpy as np
import pandas

import camopt
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.search.judge import Judge
from camopt.optimizer.search.search import find_cam

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("kodama")
low, high = scene.operation.band_rpm

# %% [markdown]
# The front is the largest area within the bounce limit, for several values of that limit: each point is a cam that the
# event-exact judge accepts at the given speeds. A crossed point means that no cam was found.

# %%
front = camopt.pareto(
    scene,
    "bounce_max_mm",
    values=(0.05,) if SMALL else (0.01, 0.05, 0.2),
    speeds="nominal" if SMALL else "band",
    gradient="exact",
)
front

# %%
front.plot()

# %% [markdown]
# Next, the cam of largest area for the train as drawn, and its worst speed: the search's judge computes the settled
# event-exact motion at speeds over the whole band.

# %%
search = find_cam(scene, "band", ACCURACIES["draft"], "exact")
cam = search.confirmed[-1].lift
judge = Judge(scene, np.linspace(low, high, 5 if SMALL else 41))
nominal = judge(cam)
print(f"worst at {nominal.worst_speed_rpm:.0f} r/min: {nominal.share.max():.0%} of a limit used")

# %% [markdown]
# The same cam in trains as built: each has its own spring, lash, masses and stiffness, drawn within the scene's
# tolerances, and a cam with its own grinding error.

# %%
rows = []
for built in camopt.trains_as_built(scene, 8 if SMALL else 100):
    judged = Judge(built.scene, judge.speeds_rpm[:: 2 if SMALL else 4])(built.cam(cam))
    worst = {f"worst {metric}": judged.worst(metric) for metric in judged.limited}
    rows.append({"train": built.number, **worst, "used part of a limit": float(judged.share.max())})
trains = pandas.DataFrame(rows).set_index("train")
held = (trains["used part of a limit"] <= 1.0).mean()
print(f"{held:.0%} of {len(trains)} trains hold every limit at these speeds")
trains.describe().loc[["min", "50%", "max"]]

# %%
figure, axes = plt.subplots(figsize=(5.2, 3.2))
for metric, limit in zip(nominal.limited, nominal.limit, strict=True):
    used = np.sort(trains[f"worst {metric}"].to_numpy() / limit)
    axes.plot(used, np.linspace(0.0, 1.0, len(used)), label=metric)
axes.axvline(1.0, color="#8a1c1c")
axes.set(xlabel="share of the limit used at the worst speed [-]", ylabel="share of trains [-]", xscale="log")
axes.legend()
plt.close(figure)
figure

# %% [markdown]
# To take all of this into account, `camopt optimize kodama --yield 0.99` searches for the largest cam with which 99 of
# 100 such trains keep the limits ([yield](../docs/explanation/yield.md)). Every verdict also sweeps the band: `verify`
# finds the worst speeds and evaluates them with every method.

# %%
verdict = camopt.verify(scene, cam, (low,) if SMALL else None, accuracy="draft")
verdict

# %%
verdict.plot()
