# %% [markdown]
# # Compare with Polydyne and Multi-Pol
#
# The cams of the literature under one scene's duration, lift and ramps: their shapes, their motion at speed, and their
# verdicts. `CAMOPT_NOTEBOOK_SIZE=small` uses the one-mass train.

# %%
import os

import matplotlib.pyplot as plt
import pandas

import camopt
from camopt.cam.lift import lift_table
from camopt.plots import profiles

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-2" if SMALL else "kodama")
speeds_rpm = (5000.0,) if SMALL else scene.operation.speeds_rpm

# %% [markdown]
# Each family has its own free parameters. Without any, `multi_pol`, `new_design`, `kurz` and `trapezoid` search for
# their member of largest area within the limits; with section angles they return the member with these angles. A
# Polydyne is designed for one speed: only at this speed does the valve follow its polynomial exactly.

# %%
cams = {
    "polydyne": camopt.polydyne(scene, exponents=(2, 10, 18, 26, 34), design_speed_rpm=5000 if SMALL else 6000),
    "multi-pol": camopt.multi_pol(scene, sections_deg=(10, 6.84, 6.84, 27.44, 20.88)),
    "new-design": camopt.new_design(scene, sections_deg=(10, 19.73, 24.84, 17.43), start_ratio=0),
    "kurz": camopt.kurz(scene, sections_deg=(24.34, 24.7, 22.96)),
    "trapezoid": camopt.trapezoid(scene, sections_deg=(4.98, 10.8, 6.62, 49.6)),
}
cams["polydyne"]

# %%
profiles([(name, lift_table(cam, 0.2)) for name, cam in cams.items()], scene.design)

# %% [markdown]
# The next figure shows the event-exact motion of the valve near its closing, in the second revolution from rest. With
# ipywidgets the speed is a slider; without them, the figure shows one speed.


# %%
def closing(speed_rpm: float):
    """Distance of the valve from its installed position over the closing side, a line per cam."""
    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    for name, cam in cams.items():
        motion = camopt.simulate(scene, cam, speed_rpm, step_deg=0.25)
        last = motion.isel(sample=motion.revolution == 2)
        axes.plot(last.cam_angle_deg, last.position_mm.sel(mass=scene.valve), label=name)
    axes.set(xlim=(60, 130), ylim=(-0.05, 1.0), xlabel="cam angle [deg]", ylabel="valve position [mm]")
    axes.set_title(f"{speed_rpm:g} r/min")
    axes.legend()
    plt.close(figure)
    return figure


try:
    from ipywidgets import FloatSlider, interactive

    slider = FloatSlider(6500, min=4000, max=8000, step=50, description="r/min", continuous_update=False)
    live = interactive(closing, speed_rpm=slider)
except ImportError:
    live = closing(6500)
live

# %% [markdown]
# Each cam gets a verdict: independent methods must agree on the motion, and every limit must hold. Families that are
# designed without a limit, such as Polydyne without the jerk limit, are rejected, and the limit is named.

# %%
compared = ("polydyne", "trapezoid") if SMALL else tuple(cams)
verdicts = {name: camopt.verify(scene, cams[name], speeds_rpm, accuracy="draft") for name in compared}
verdicts["polydyne"]

# %%
top_mm = scene.design.max_lift_mm
pandas.DataFrame(
    [
        {
            "cam": name,
            "area ratio": cams[name].area_ratio(top_mm * 1e-3),
            "verdict": verdict.verdict,
            "broken": ", ".join(verdict.broken),
        }
        for name, verdict in verdicts.items()
    ]
)

# %% [markdown]
# `camopt compare kodama --design runs/nominal --out runs/comparison` does this for every family and a design of your
# own (`camopt.compare` in Python), with and without the jerk limit, and draws the figures; with `--baselines best` the
# best member of each family is searched first.
