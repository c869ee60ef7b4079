"""When does the follower of arXiv 0711.1008 leave its cam, how does it move then, and which cam keeps it longest?

A rigid follower of 1.221 kg on a spring of 1430.8 N/m, with restitution 0.8, on a cam of arcs. camopt's own contact
is stiff, with the damping of that restitution; the motions are told at three stiffnesses, so that one sees what hangs
on them. Long motions are classed by what their states at -180 deg do over the last revolutions.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from camopt.cam.lift import Lift
from camopt.exact import prepare
from camopt.plots.style import new_figure
from camopt.scene import build_train, load_scene, state_at_rest
from camopt.scene.train import Train
from camopt.scene.units import DEG, MM, RPM
from experiments.support.cam_follower_parts import (
    RESTITUTION,
    TIP,
    bound_on_decline,
    cam_of,
    damping_of,
    highest_rise,
    least_decline,
    profile,
    rigid_detachment,
)
from experiments.support.record import RESULTS, run_script, write_result

SCENE = Path(__file__).parent / "support" / "cam_follower.toml"
PUBLISHED_RPM = (358, 660, 700)
STIFFNESS = {"small": (1e8,), "full": (1e8, 1e9, 1e10)}
FADING = {"small": 100, "full": 1000}
"""Revolutions before a long motion is looked at."""
LOOKED_AT = {"small": 32, "full": 256}
SAME = 1e-6
"""Distance of two states [m] below which they count as one."""
NEIGHBOUR = 1e-9
"""Distance [m] at which a second motion starts, to see whether it stays near."""
OVERDAMPED = 20.0
"""Damping ratio of the contact that the detachment is looked for with: where the cam's acceleration steps, the force
overshoots by a 1600th part of the step."""
KNOTS = {"small": 101, "full": 801}
PUSHES = (None, 1.0, 10.0)
"""Largest accelerations [m/rad^2] of the cams that keep the follower on longest; None: that of the source's cam."""


def main(size: str, folder=RESULTS) -> dict:
    """Detachment, motions and the cams that keep the follower on longest."""
    scene = load_scene(SCENE)
    cam, given = profile(), build_train(scene)
    speed, angle = rigid_detachment(cam, given)
    content: dict = {
        "lift_m": cam.max_lift,
        "detachment": {"rigid_rpm": speed / RPM, "cam_angle_deg": 180.0 + abs(angle) / DEG},
        "motions": [motion(given, cam, k, rpm, size) for rpm in PUBLISHED_RPM for k in STIFFNESS[size]],
        "longest_on": [longest_on(given, cam, push, KNOTS[size]) for push in PUSHES],
    }
    content["detachment"]["compliant_rpm"] = {f"{k:g}": first_loss(given, cam, k) for k in STIFFNESS[size]}
    figures = {"motions": draw(given, cam)} if size == "full" else {}
    return write_result("cam_follower", size, content, figures, folder)


def with_contact(train: Train, stiffness: float, damping: float) -> Train:
    """The train with that contact at the cam, its first element."""
    stiffnesses, dampings = train.stiffness.copy(), train.damping.copy()
    stiffnesses[0], dampings[0] = stiffness, damping
    return replace(train, stiffness=stiffnesses, damping=dampings)


def first_loss(given: Train, cam: Lift, stiffness: float) -> float:
    """Speed [r/min] from which a contact so damped that its force hardly overshoots loses its force, to 0.01."""
    train = with_contact(given, stiffness, 2.0 * OVERDAMPED * np.sqrt(stiffness * given.mass[0]))

    def lost(rpm: float) -> bool:
        revolve = prepare(train, cam, rpm * RPM)
        return bool(np.any(revolve(revolve.advance(state_at_rest(train))).force[:, 0] <= 0.0))

    low, high = 100.0, 130.0
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (low, middle) if lost(middle) else (middle, high)
    return high


def motion(given: Train, cam: Lift, stiffness: float, rpm: float, size: str) -> dict:
    """What a long motion is: its period in revolutions, or none, and how fast a neighbour leaves it."""
    train = with_contact(given, stiffness, damping_of(RESTITUTION, stiffness, given.mass[0]))
    revolve, state = prepare(train, cam, rpm * RPM), state_at_rest(train)
    state = revolve.advance(state, FADING[size])
    near, growth, states, hops = state + np.array([NEIGHBOUR, 0.0]), [], [state], []
    for _ in range(LOOKED_AT[size]):
        response = revolve(state)
        hops.append(float(response.separation(0).max()))
        state, near = revolve.advance(state), revolve.advance(near)
        apart = max(abs(near[0] - state[0]), 1e-15)
        growth.append(np.log(apart / NEIGHBOUR))
        near = state + (near - state) * NEIGHBOUR / apart
        states.append(state)
    x = np.array(states)[:, 0]
    repeats = [p for p in range(1, len(x) // 2) if np.abs(x[p:] - x[:-p])[-len(x) // 2 :].max() < SAME]
    return {
        "speed_rpm": rpm,
        "stiffness_N_per_m": stiffness,
        "period_revolutions": repeats[0] if repeats else None,
        "largest_hop_mm": [min(hops) / MM, max(hops) / MM],
        "growth_per_revolution": float(np.exp(np.mean(growth))),
    }


def longest_on(train: Train, cam: Lift, push: float | None, knots: int) -> dict:
    """The symmetric cam of the same rise and dwell that a rigid follower leaves last, with the bound on its speed."""
    most = cam.extremes(2)[1] if push is None else push
    natural = np.sqrt(train.stiffness[1] / train.mass[0])
    shift = train.preload[1] / train.stiffness[1]
    bound = natural / np.sqrt(bound_on_decline(cam.max_lift, most, shift, TIP))
    found = cam_of(highest_rise(least_decline(cam.max_lift, most, shift, TIP, knots), most, shift, TIP, knots))
    return {
        "acceleration_max_m_per_rad2": most,
        "detachment_rpm": rigid_detachment(found, train)[0] / RPM,
        "bound_rpm": bound / RPM,
        "lift_m": found.max_lift,
    }


def draw(given: Train, cam: Lift) -> Figure:
    """Follower and cam over three revolutions at the published speeds, after the motion's beginning has faded."""
    chart = new_figure(7.0, 7.0)
    chart.subplots(3, 1, sharex=True)
    train = with_contact(given, 1e9, damping_of(RESTITUTION, 1e9, given.mass[0]))
    for axes, rpm in zip(chart.axes, PUBLISHED_RPM, strict=True):
        revolve = prepare(train, cam, rpm * RPM)
        state = revolve.advance(state_at_rest(train), FADING["full"])
        for turn in range(3):
            response = revolve(state)
            at = response.angle / DEG + 360.0 * turn
            axes.plot(at, response.lift / MM, color="0.6", lw=1.0, label="cam" if turn == 0 else None)
            axes.plot(at, response.x[:, 0] / MM, color="C0", lw=1.2, label="follower" if turn == 0 else None)
            state = revolve.advance(state)
        axes.set_ylabel("lift [mm]")
        axes.set_title(f"{rpm} r/min")
    chart.axes[0].legend(loc="upper right")
    chart.axes[-1].set_xlabel("cam angle [deg]")
    return chart


if __name__ == "__main__":
    run_script(main, __doc__)
