# %% [markdown]
# # First design
#
# From a scene to a cam that independent methods confirm, first by hand and then by the search. Open this file as a
# notebook (JupyterLab with jupytext, VS Code and Spyder read the percent format) or run it as a script:
# `python notebooks/first_design.py`. The small size, `CAMOPT_NOTEBOOK_SIZE=small`, uses the one-mass train and takes
# seconds; the full size designs for the train of ten masses and takes minutes.

# %%
import os

import matplotlib.pyplot as plt
import numpy as np
import pandas
from scipy.optimize import linprog

import camopt
from camopt.optimizer.search.judge import Judge
from camopt.report import write_report

SIZE = os.environ.get("CAMOPT_NOTEBOOK_SIZE", "full")
SMALL = SIZE == "small"
scene = camopt.load_scene("motori-1" if SMALL else "kodama")
design, operation = scene.design, scene.operation

# %% [markdown]
# The scene has limits on the shape, limits on the motion, and the speeds at which they must hold.

# %%
design.model_dump(exclude_none=True)

# %% [markdown]
# How much area can any cam have within these limits? The bound comes from weak duality: no cam exceeds it, spline or
# not. `worth_percent` says by how many per cent the area grows if a limit is raised by 1 %.

# %%
camopt.area_bound(scene, knot_deg=4.0 if SMALL else 2.0)

# %% [markdown]
# ## The calmest cam
#
# The acceleration of a free cam is a spline between the scene's ramps. Its free coefficients are called $z$. The search
# begins with $z = 0$, which is the spline with the smallest coefficients that joins both ramps: it hardly lifts the
# valve, and it hardly excites the train. `camopt.ascend(start="calmest")` also begins there.

# %%
free = camopt.free_cam(design, 6.0 if SMALL else 3.0)
z = np.zeros(free.Z.shape[1])
calmest = free.lift(z)
calmest.plot(design)

# %% [markdown]
# The judge computes the settled event-exact motion, in which contacts can open, at every requested speed. The table
# shows the part of each limit on the motion that the calmest cam uses at its worst speed: 1 is the whole limit.

# %%
speeds_rpm = operation.speeds_rpm if SMALL else np.linspace(*operation.band_rpm, 9)
judge = Judge(scene, speeds_rpm)


def shares(cam):
    """The area ratio of a cam, and the part of each limit on the motion that it uses at its worst speed."""
    judged = judge(cam)
    used = dict(zip(judged.limited, judged.share.max(axis=1), strict=True))
    return {"area ratio": cam.area_ratio(design.max_lift_mm * 1e-3)} | used


pandas.DataFrame([shares(calmest)], index=["calmest"])

# %% [markdown]
# ## The motion and its Jacobian
#
# An open contact has zero force with zero derivative, which does not show how to close it. So the contacts between cam
# and valve are *tied* here: inside the event they pull where they would open. A negative force then shows where, and
# how strongly, the real contact tends to open. `linearised` gives these forces along the event at every speed, with
# their derivatives with respect to the coefficients: the Jacobian. The full size computes it with JAX from the smoothed
# motion, as the search does, which works for any force law. The small size uses the closed periodic response, which
# exists for this train because its laws are piecewise linear.

# %%
SOURCE = "exact" if SMALL else "smooth"
linear = camopt.linearised(scene, calmest, speeds_rpm=speeds_rpm, source=SOURCE)
inside = np.abs(linear.cam_angle_deg.values) < design.duration_deg / 2 - 5
force = linear.contact_force_N.values[:, inside]  # speed, angle, contact
jacobian = linear.contact_force_N_by_z.values[:, inside]  # and coefficient
angle_deg = linear.cam_angle_deg.values[inside]

# %%
figure, (above, below) = plt.subplots(2, 1, figsize=(6.2, 5.0), sharex=True, layout="constrained")
for i, speed in enumerate(speeds_rpm):
    above.plot(angle_deg, force[i].min(axis=1), label=f"{speed:.0f} r/min")
middle = len(z) // 2
below.plot(angle_deg, jacobian[-1, :, 0, [middle // 2, middle, middle + middle // 2]].T * 1e-3)
above.set(ylabel="least contact force [N]", title="calmest cam, contacts tied")
below.set(xlabel="cam angle [deg]", ylabel="derivative by three of\nthe coefficients [N/(µm/deg²)]")
above.legend(fontsize="small")
plt.close(figure)
figure

# %% [markdown]
# ## One program by hand
#
# The area is a linear function of the coefficients, and so are the limits on the shape. With the Jacobian the contact
# forces are approximately linear too, near the cam at which it was computed. So the largest area is the solution of a
# linear program in $z$: force plus Jacobian times step must be at least a margin, at every angle and speed, within a
# trust region, a box about the present cam. The search shrinks the box where the linearisation predicted the forces
# badly, and enlarges it where the prediction was good.

# %%
MARGIN_N, BOX = 10.0, 0.01  # the box in mm/deg^2, as the coefficients
limits, (area_row, _) = free.limits(design), free.area()
slopes = jacobian.reshape(-1, len(z))
matrix = np.vstack([limits.matrix, -slopes])
bound = np.append(limits.bound, force.ravel() + slopes @ z - MARGIN_N)
size = np.abs(matrix).max(axis=1)  # rows in newtons and rows in metres then count alike
rows = size > 0
solved = linprog(
    -area_row / np.abs(area_row).max(),
    A_ub=matrix[rows] / size[rows, None],
    b_ub=bound[rows] / size[rows],
    bounds=np.column_stack([z - BOX, z + BOX]),
)
assert solved.success, solved.message
by_hand = free.lift(solved.x)
foretold = force + jacobian @ (solved.x - z)

# %% [markdown]
# How well did the linearisation predict the forces of the new cam? The tied motion with the new cam shows this.

# %%
again = camopt.linearised(scene, by_hand, speeds_rpm=speeds_rpm, source=SOURCE).contact_force_N.values[:, inside]
figure, axes = plt.subplots(figsize=(6.2, 3.2), layout="constrained")
axes.plot(angle_deg, force[-1].min(axis=1), color="0.6", label="calmest cam")
axes.plot(angle_deg, foretold[-1].min(axis=1), label="new cam, foretold")
axes.plot(angle_deg, again[-1].min(axis=1), "--", label="new cam, its own motion")
axes.axhline(MARGIN_N, color="#8a1c1c", linewidth=0.8, label="margin")
axes.set(xlabel="cam angle [deg]", ylabel="least contact force [N]", title=f"{speeds_rpm[-1]:.0f} r/min")
axes.legend(fontsize="small")
plt.close(figure)
figure

# %% [markdown]
# The judge evaluates the motion of the new cam with real contacts, which can open.

# %%
pandas.DataFrame([shares(calmest), shares(by_hand)], index=["calmest", "by hand"])

# %% [markdown]
# ## The search
#
# `camopt.optimize` repeats this step about each new cam, until the predicted gain in area is small. These steps are the
# stage *path constraints* below, with fixed margins. But a margin on the force is not a limit of the scene, which
# limits bounce and jump. So the judge measures how much of each limit a cam uses, and the margin of each flank at each
# speed is adjusted: above 0.8 of a limit the margin rises and the next cam excites less vibration; below, it falls and
# the next cam is larger. It may become negative, as a contact may open as far as the limit on the jump permits. The
# last steps are *between two cams*, the largest that keeps the limits and a larger one that does not.

# %%
run = camopt.optimize(
    scene,
    speeds="nominal" if SMALL else "band",
    accuracy="draft" if SMALL else "standard",
    gradient=SOURCE,
)
steps = pandas.read_json(run.folder / "history.jsonl", lines=True).set_index("iteration")
steps[["stage", "area_ratio", "worst_bounce_mm", "worst_jump_mm", "worst_share", "worst_speed_rpm", "confirmed"]]

# %% [markdown]
# The search marks a cam as confirmed if it uses at most 0.9 of every limit and is larger than the previous ones. The
# reserve is needed for the speeds in between, which the verdict also evaluates.

# %%
figure, (above, below) = plt.subplots(2, 1, figsize=(6.2, 4.8), sharex=True, layout="constrained")
above.plot(steps.area_ratio, ".-", color="0.4")
above.plot(steps.area_ratio[steps.confirmed], "o", color="#0072B2", label="holds, and larger than those before")
below.semilogy(steps.worst_share.where(np.isfinite(steps.worst_share)), ".-", color="0.4")
below.axhline(0.9, color="#8a1c1c", linewidth=0.8)
fed = steps.index[steps.stage == "margins fed back"]
for axes in (above, below):
    axes.axvspan(fed.min() - 0.5, fed.max() + 0.5, color="0.93", label="margins fed back")
above.set(ylabel="area ratio [-]")
below.set(xlabel="step", ylabel="largest share of a limit [-]")
above.legend(fontsize="small")
plt.close(figure)
figure

# %% [markdown]
# ## The verdict
#
# Only cams that independent methods confirm are accepted: these methods compute the motion in steps, with their own
# contact laws, and share no code with the search.

# %%
run

# %% [markdown]
# The figures show the cam with the scene's limits drawn, and its bounce and jump against speed.

# %%
run.lift.plot(design)

# %%
run.plot()

# %% [markdown]
# The run folder has the lift table for the grinder, every figure, and a report that opens offline.

# %%
print(write_report(run.folder))
print(sorted(path.name for path in run.folder.iterdir()))

# %% [markdown]
# The same from a terminal: `camopt optimize kodama`. Every command can read the folder as a cam:
# `camopt verify kodama --cam runs/...`.

# %%
camopt.read_cam(run.folder, scene)
