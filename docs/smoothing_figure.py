"""The figure of docs/how-to/smoothing.md: a contact's force by the width of its layer and by the share of the tie."""

import numpy as np

from camopt.plots.style import INK, LIMIT, new_figure, styled

SCENE, SPEED_RPM = "kodama", 7000
"""At this speed the scene's Polydyne jumps."""
WIDTHS_UM = (2.0, 6.0)
TIES = {0.0: "#9A6A00", 0.01: "#009E73", 1.0: "#0072B2"}


@styled
def smoothing():
    """Force by compression for two widths, and force by angle for three shares of the tie."""
    import camopt.smooth
    from camopt.smooth.laws import Layer, raw_force

    figure = new_figure(8.4, 3.4)
    layer, tie = figure.subplots(1, 2, width_ratios=(1, 1.35))
    u = np.linspace(-4.0, 6.0, 400)
    layer.plot(u, np.maximum(u, 0.0), color=INK, label="law of the scene")
    for width, line in zip(WIDTHS_UM, ((0, (5, 2)), (0, (1, 1.5))), strict=True):
        force = raw_force(u * 1e-6, 0.0 * u, 1e6, 0.0, Layer(width * 1e-6))
        layer.plot(u, np.asarray(force), color=LIMIT, linestyle=line, label=f"width_um = {width:g}")
    layer.set(xlabel="compression [um]", ylabel="force [N] at 1 N/um", title="The layer")
    layer.legend(fontsize="small")
    scene = camopt.load_scene(SCENE)
    cam = camopt.polydyne(scene)
    contact = next(one.name for one in scene.element if one.cam_driven)
    motions = {"exact": camopt.simulate(scene, cam, SPEED_RPM)}
    motions |= {f"tie = {share:g}": camopt.simulate(scene, cam, SPEED_RPM, "smooth", tie=share) for share in TIES}
    for (name, motion), color in zip(motions.items(), (INK, *TIES.values()), strict=True):
        shown = (motion.revolution == 1) & (abs(motion.cam_angle_deg) < 80)
        force = motion.force_N.sel(element=contact)[shown]
        line = (0, (5, 2)) if name == "tie = 0" else "-"
        tie.plot(motion.cam_angle_deg[shown], force, color=color, label=name, linestyle=line, linewidth=1.2)
    tie.axhline(0.0, color=INK, linewidth=0.6)
    tie.set(xlabel="cam angle [deg]", ylabel="force at the cam [N]", ylim=(-500, 1800), title="The tie")
    tie.legend(fontsize="small", ncols=2)
    return figure
