# %% [markdown]
# # Speed against accuracy
#
# The cost of an accurate motion, error and time of smaller models, and the meaning of `accuracy` in a verdict.

# %%
import os
import time

import matplotlib.pyplot as plt
import numpy as np
import pandas

import camopt
from camopt.verifier.accuracy import EFFORTS

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")
cam = camopt.polydyne(scene)

# %% [markdown]
# First, a single motion. Event-exact locates every opening and closing, so its accuracy does not depend on the step;
# Runge-Kutta-Gill and Houbolt step over these instants, and their error falls with the first power of the step.


# %%
def error_and_time(method: str, step_deg: float) -> tuple[float, float]:
    """Largest error of the valve's position [um] over one revolution at 6000 r/min, and the time it took [s]."""
    camopt.simulate(scene, cam, 6000, method, revolutions=1, step_deg=step_deg)  # compiles what is not compiled yet
    begin = time.perf_counter()
    motion = camopt.simulate(scene, cam, 6000, method, revolutions=1, step_deg=step_deg)
    seconds = time.perf_counter() - begin
    every = round(step_deg / FINEST_DEG)
    exact = truth.position_mm.sel(mass=scene.valve).values[::every]
    return 1e3 * float(np.abs(motion.position_mm.sel(mass=scene.valve).values - exact).max()), seconds


FINEST_DEG = 0.01
truth = camopt.simulate(scene, cam, 6000, "event", revolutions=1, step_deg=FINEST_DEG)
rows = []
for method in ("event", "rkg", "houbolt"):
    for step_deg in (0.1, 0.03, 0.01):
        error_um, seconds = error_and_time(method, step_deg)
        rows.append({"method": method, "step [deg]": step_deg, "error [um]": error_um, "time [s]": seconds})
table = pandas.DataFrame(rows)
table

# %%
figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
for method, part in table.groupby("method"):
    axes.loglog(part["error [um]"].clip(lower=1e-9), part["time [s]"], "o-", label=method)
axes.set(xlabel="largest error [um]", ylabel="time of a revolution, with tables [s]")
axes.legend()
plt.close(figure)
figure

# %% [markdown]
# The `accuracy` of a verdict determines how many methods must agree, how finely the band is swept, and the largest
# permitted change when a step is halved; it may also be a number of micrometres.

# %%
pandas.DataFrame(EFFORTS.values(), index=list(EFFORTS))

# %%
verdicts = {}
for accuracy in ("draft",) if SMALL else ("draft", "standard"):
    begin = time.perf_counter()
    verdicts[accuracy] = camopt.verify(scene, cam, (5000.0,), accuracy=accuracy)
    print(f"{accuracy}: {verdicts[accuracy].verdict} in {time.perf_counter() - begin:.1f} s")
verdicts["draft"]

# %% [markdown]
# A smaller model is faster but has an additional error. `reduce` tries every combination of fewer spring masses and
# condensed masses, and reports its error and its time. It proposes the cheapest one within the tolerance, and monitors
# a contact that was left out because it never closes.

# %%
camopt.reduce(scene, cam, speeds_rpm=(5000,), tolerance_mm=0.02)
