"""What are the natural frequencies of the built-in trains, and which cam harmonics coincide with the spring's surge?

Surge modes are those of the masses of a divided valve spring between fixed ends. These masses are identified as the
ones that are connected to preloaded elements only. The modes of `ohv-3dof` are compared with an eigen analysis of a
valve train in the literature (Tables 1 and 2).
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.linalg import eigh

from camopt.cam.families.polydyne import polydyne
from camopt.plots import modes as draw_modes
from camopt.plots.style import BASE, DESIGN, SHADE, cam_line, new_figure, styled
from camopt.scene import Scene, build_train, builtin_scenes, load_scene
from camopt.scene.units import MM
from camopt.scene.vibration import assembled
from camopt.study.modes import modes
from experiments.support.record import RESULTS, run_script, write_result


@styled
def campbell(
    frequency_Hz: Sequence[float],
    orders: Sequence[int],
    band_rpm: tuple[float, float],
    cam_per_crank: float,
    title: str = "",
) -> Figure:
    """Draws the frequencies (m) as horizontal lines and the cam's harmonics `orders` as rays over the crankshaft speed.

    Dots mark the crossings inside the band, which is shaded.
    """
    figure = new_figure(7.6, 4.6)
    axes = figure.subplots()
    low, high = band_rpm
    speed = np.array([0.9 * low, 1.08 * high])
    per_order = speed * cam_per_crank / 60
    top = 1.12 * max(frequency_Hz)
    axes.axvspan(low, high, color=SHADE, zorder=0)
    for order in orders:
        ray = order * per_order
        axes.plot(speed, ray, color="#888888", linewidth=0.7, zorder=2)
        _name_ray(axes, order, speed[1], ray[1], top)
        for f in frequency_Hz:
            at = f * 60 / (order * cam_per_crank)
            if low <= at <= high:
                axes.plot(at, f, "o", color=cam_line("polydyne")["color"], markersize=4, zorder=4)
    for f in frequency_Hz:
        axes.axhline(f, color=cam_line(DESIGN)["color"], linewidth=1.4, zorder=3)
        axes.annotate(f"{f:.0f} Hz", (speed[0], f), xytext=(3, 2), textcoords="offset points", fontsize=BASE - 1.5)
    axes.set(xlim=speed, ylim=(0, top), xlabel="crankshaft speed [r/min]", ylabel="frequency [Hz]")
    axes.set_title(title, pad=14)  # above the orders
    return figure


def _name_ray(axes: Axes, order: int, end: float, height: float, top: float) -> None:
    """Writes the order of a ray from the origin to (end, height) where it leaves the axes: right, or at the top."""
    right = height < top
    at = (end, height) if right else (end * top / height, top)
    shift, horizontal, vertical = ((2, 0), "left", "center") if right else ((0, 3), "center", "bottom")
    axes.annotate(f"{order}", at, xytext=shift, textcoords="offset points", ha=horizontal, va=vertical,
                  fontsize=BASE - 2)  # fmt: skip


PAPER_HZ = (2832.25, 15642.9, 72247.8)
PAPER_SHAPES = ((0.6894, 0.6557, 0.3078), (-0.0217, 0.0745, 0.9970), (0.0104, -0.9997, 0.0232))
STATES = ("lifted", "seated")
LISTED = 15
"""Largest number of modes that are written per scene and state, the lowest ones."""


def main(size: str, folder=RESULTS) -> dict:
    """Modes of every built-in scene, surge and the paper's tables; figures of two masses or more (full size)."""
    scenes = {name: load_scene(name) for name in builtin_scenes()}
    content: dict = {"modes": {}, "surge": {}, "ohv_3dof": beside_the_paper(scenes["ohv-3dof"])}
    figures: dict[str, Figure] = {}
    for name, scene in scenes.items():
        states = STATES if scene.seat else STATES[:1]
        by_state = {state: modes(scene, state) for state in states}
        content["modes"][name] = {
            s: {"frequency_Hz": m.frequency_Hz[:LISTED], "damping_ratio": m.damping_ratio[:LISTED], "closed": m.closed}
            for s, m in by_state.items()
        }
        lifted = by_state["lifted"]
        if size == "full" and len(scene.mass) > 1:
            what = f"{name}, lifted" if scene.seat else name
            figures[name] = draw_modes(lifted.frequency_Hz, lifted.shape, lifted.mass_names, what)
        surge = surge_frequencies(scene)
        if len(surge) and scene.operation and scene.design:
            rows = meetings(scene, surge)
            content["surge"][name] = {"frequency_Hz": surge, "harmonics_in_band": rows}
            orders = sorted({row["order"] for row in rows})
            if size == "full":
                figures[f"{name}-surge"] = campbell(
                    list(surge), orders, scene.operation.band_rpm, scene.operation.cam_per_crank,
                    f"{name}: surge of the valve spring (both ends fixed) and the cam's harmonics",
                )  # fmt: skip
    return write_result("modes", size, content, figures, folder)


def surge_frequencies(scene: Scene) -> np.ndarray:
    """Undamped frequencies [Hz] of the spring's masses between fixed ends, ascending; empty for a massless spring."""
    train = build_train(scene)
    touching = [(train.a == i) | (train.b == i) for i in range(len(train.mass))]
    spring = [i for i, at in enumerate(touching) if np.all(train.preload[at] > 0) and i != train.valve]
    if not spring:
        return np.array([])
    _, stiffness = assembled(train, np.ones(len(train.a), dtype=bool))
    squares = eigh(stiffness[np.ix_(spring, spring)], np.diag(train.mass[spring]), eigvals_only=True)
    return np.sqrt(squares) / (2 * np.pi)


def meetings(scene: Scene, surge: np.ndarray) -> list[dict]:
    """Every crossing of a cam harmonic and a surge frequency in the band, and the harmonic of a Polydyne lift."""
    (low, high), ratio = scene.required_operation.band_rpm, scene.required_operation.cam_per_crank
    angle = np.linspace(-np.pi, np.pi, 7200, endpoint=False)
    amplitude = 2 * np.abs(np.fft.rfft(polydyne(scene)(angle))) / len(angle) / MM
    rows = []
    for mode, f in enumerate(surge, 1):
        orders = range(int(np.ceil(f * 60 / (high * ratio))), int(f * 60 / (low * ratio)) + 1)
        rows += [
            {"mode": mode, "frequency_Hz": f, "order": n, "speed_rpm": f * 60 / (n * ratio),
             "polydyne_lift_harmonic_um": 1e3 * amplitude[n]}
            for n in orders
        ]  # fmt: skip
    return rows


def beside_the_paper(scene: Scene) -> list[dict]:
    """Tables 1 and 2 of the eigen analysis with the modes by camopt; the sign of a shape is arbitrary."""
    computed = modes(scene)
    rows = []
    for i, (hz, shape) in enumerate(zip(PAPER_HZ, PAPER_SHAPES, strict=True)):
        sign = np.sign(computed.shape[i] @ np.array(shape))
        rows.append({"mode": i + 1, "paper_Hz": hz, "frequency_Hz": computed.frequency_Hz[i], "paper_shape": shape,
                     "shape": sign * computed.shape[i]})  # fmt: skip
    return rows


if __name__ == "__main__":
    run_script(main, __doc__)
