# %% [markdown]
# # A thousand valve trains
#
# No two engines are built alike. How many of a thousand trains, each with its own spring, lash and masses within the
# tolerances of a scene, keep the limits with one cam? `camopt.sweep` computes them on all cores or on a cluster, and
# stores a row for each; recorded rows survive any interruption. ([The page](../docs/thousand-trains.md) says more.)

# %%
import os
import tempfile
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import camopt
from camopt.tasks.engines import cluster

SMALL = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full") == "small"
TRAINS = 12 if SMALL else 1000
SPEEDS = [5300] if SMALL else [5300, 5450, 5600]
folder = Path(tempfile.mkdtemp())
scene = camopt.load_scene("motori-1")
{f"{', '.join(t.of) if isinstance(t.of, tuple) else t.of}": t.relative or t.plus_minus for t in scene.tolerance}

# %% [markdown]
# A task is plain data. Train 17 is the same train in every process, so tasks may be computed in any order.


# %%
def trains(count):
    """The tasks: drawn trains under the plain Polydyne."""
    for i in range(count):
        yield {"verb": "yield", "scene": "motori-1", "cam": "polydyne", "speeds_rpm": SPEEDS, "train": i}


begin = time.perf_counter()
found = camopt.sweep(trains(TRAINS), folder / "trains.sqlite", workers=0 if SMALL else None)
seconds = time.perf_counter() - begin
found

# %% [markdown]
# The rows are a labelled dataset: how much of each limit a train uses at its worst speed, and whether it keeps them.

# %%
data = found.dataset()
f"{float(data['holds'].mean()):.1%} of {TRAINS} trains hold every limit at {SPEEDS} r/min"

# %%
rows = list(found.rows())
figure, axes = plt.subplots(figsize=(5.2, 3.2))
for limit in [name for name in rows[0] if name.startswith("used_")]:
    used = np.sort([max(row[limit]) for row in rows])
    axes.plot(used, np.linspace(0.0, 1.0, len(used)), label=limit.removeprefix("used_"))
axes.axvline(1.0, color="#8a1c1c")
axes.set(xlabel="share of the limit used at the worst speed [-]", ylabel="share of trains [-]", xscale="log")
axes.legend()
plt.close(figure)
figure

# %% [markdown]
# ## What a row costs

# %%
size = (folder / "trains.sqlite").stat().st_size
f"{1000 * seconds / TRAINS:.0f} ms by the clock and {size / TRAINS:.0f} bytes for each train"

# %% [markdown]
# ## Continuing a sweep
#
# The same call again computes nothing, since every row is stored. With more trains only the new ones are computed.

# %%
begin = time.perf_counter()
more = camopt.sweep(trains(TRAINS + 2), folder / "trains.sqlite", workers=0)
print(f"two more trains took {time.perf_counter() - begin:.1f} s")
more

# %% [markdown]
# ## What happens when a worker dies
#
# The sweep starts another worker and sends the lost tasks again. A task that was lost with three workers gets a row
# "failed", and the other tasks continue. In this example one task kills every process that computes it.

# %%
deadly = [{"verb": "rehearse", "number": i, "end": "die" if i == 3 else ""} for i in range(8)]
after = camopt.sweep(deadly, folder / "deadly.sqlite", workers=1)
print(after.failed()[0]["reason"])
after

# %% [markdown]
# ## A cluster
#
# The same tasks can run on workers of [dask](https://distributed.dask.org): here two processes on this machine, on a
# real cluster those of a scheduler's address. The dashboard shows their activity. The rows are the same.

# %%
try:
    from distributed import LocalCluster
except ImportError:
    print("pip install 'camopt[cluster]' brings dask.distributed")
else:
    with LocalCluster(2, processes=True, threads_per_worker=1, dashboard_address=":0", silence_logs=50) as machine:
        print("dashboard:", machine.dashboard_link)
        with cluster(machine.scheduler_address) as (executor, workers):
            some = camopt.sweep(trains(4), folder / "cluster.sqlite", executor, workers)
    print("the same rows:", [*some.rows()] == rows[:4])
