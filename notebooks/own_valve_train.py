# %% [markdown]
# # Bring your own valve train and measured lift
#
# A scene is a text file with masses, springs and contacts; a cam may be a table from a measuring machine.

# %%
import os
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import camopt
from camopt.scene import InputError, parse_scene

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
folder = Path(tempfile.mkdtemp())

# %% [markdown]
# This train has two masses, a tappet and a valve: the cam drives the tappet through a contact, the tappet pushes the
# valve through another contact, which has the lash, and the spring holds the valve on its seat. `help(camopt.scene)`
# explains the keys.

# %%
MINE = """
format = 1
name = "mine"
title = "tappet and valve"
valve = "valve"
seat = "seat"

[operation]
speeds_rpm = [4000, 5000]
band_rpm = [3000, 5000]
cam_per_crank = 0.5

[design]
duration_deg = 130
max_lift_mm = 8.5
ramp_height_mm = 0.25
ramp_velocity_mm_per_deg = 0.012
ramp_foot_deg = 10
acceleration_max_mm_per_deg2 = 0.02
acceleration_min_mm_per_deg2 = -0.009
bounce_max_mm = 0.05
jump_max_mm = 0.05

[[mass]]
name = "tappet"
mass_kg = 0.06
source = "scales"

[[mass]]
name = "valve"
mass_kg = 0.11
damping_N_s_per_m = 2.0
assumed = ["damping_N_s_per_m"]

[[element]]
name = "cam"
kind = "contact"
between = ["ground", "tappet"]
cam_driven = true
stiffness_N_per_m = 4.0e7
damping_N_s_per_m = 600.0

[[element]]
name = "tappet_spring"
kind = "spring"
between = ["tappet", "ground"]
stiffness_N_per_m = 2000.0
preload_N = 20.0

[[element]]
name = "tip"
kind = "contact"
between = ["tappet", "valve"]
stiffness_N_per_m = 6.0e7
damping_N_s_per_m = 700.0
gap_mm = 0.2

[[element]]
name = "spring"
kind = "spring"
between = ["valve", "ground"]
stiffness_N_per_m = 32000.0
preload_N = 260.0

[[element]]
name = "seat"
kind = "contact"
between = ["ground", "valve"]
stiffness_N_per_m = 1.2e8
damping_N_s_per_m = 2500.0
preload_N = 260.0
"""
(folder / "mine.toml").write_text(MINE)
scene = camopt.load_scene(folder / "mine.toml")

# %% [markdown]
# All faults of a file are reported at once, each with its key.

# %%
try:
    parse_scene(
        MINE.replace("mass_kg = 0.06", "mass_kg = -1").replace('"tappet", "valve"]', '"tapet", "valve"]'), "mine"
    )
except InputError as fault:
    print(fault)

# %% [markdown]
# The natural frequencies with the valve lifted are a first check. If measured ones differ, a mass or a stiffness is
# wrong.

# %%
found = camopt.modes(scene, "lifted")
found

# %%
found.plot()

# %% [markdown]
# A measured cam is a table. Here one is made from a Polydyne, in steps of 1 crank degree with 2 um of noise, so that
# the true lift is known. The header gives angle and unit; a table without one needs `table_angle` and `table_lift`.

# %%
truth = camopt.polydyne(scene)
crank_deg = np.arange(-360.0, 361.0)
rise_mm = truth(np.radians(crank_deg / 2)) * 1e3
noise_mm = np.random.default_rng(1).normal(0.0, 0.002, len(crank_deg))
table = folder / "measured.csv"
np.savetxt(table, np.column_stack([crank_deg, rise_mm + noise_mm]), header="table-angle = crank\ntable-lift = mm")
cam = camopt.read_lift_table(table, scene)
cam

# %% [markdown]
# The noise of the table is estimated, and the lift is smoothed within it; the acceleration follows from the smoothed
# lift, with the error that the parameters above state.

# %%
theta = np.linspace(-1.1, 1.1, 500)
error = np.sqrt(np.mean((cam(theta, 2) - truth(theta, 2)) ** 2)) / np.abs(truth(theta, 2)).max()
print(f"acceleration: {100 * error:.1f} % of its peak off, root mean square")

# %%
cam.plot(scene.design)

# %% [markdown]
# The motion is a labelled dataset, and the verdict judges it.

# %%
motion = camopt.simulate(scene, cam, 4500)
motion

# %%
(line,) = motion.position_mm.sel(mass=scene.valve).plot(x="time_s")
plt.close(line.figure)
line.figure

# %%
camopt.verify(scene, cam, speeds_rpm=(4000.0,), accuracy="draft")
