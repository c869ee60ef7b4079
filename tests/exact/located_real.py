"""An independent reference: DOP853 with every switching located for the scene `tests/scene/real.toml`, by hand.

Two masses, a linear cam contact, an adjuster (plunger between stops, oil), a table spring, friction, a seat, gas force.
Nothing of the package is used but the lift's values and the numbers of the scene file, which stand here once more.
"""

import numpy as np
from scipy.integrate import solve_ivp

TAPPET, VALVE = 0.1, 0.12
CAM, CAM_DAMPER, SEAT, SEAT_DAMPER, SEAT_PRELOAD = 4.0e7, 500.0, 5.0e7, 1500.0, 250.0
OIL, LEAK, TRAVEL = 2.0e7, 2.0e6, 2.0e-5
PLUNGER_D, PLUNGER_F = [-1.5e-3 - 37.0 / OIL, -1.5e-3, 1.5e-3, 2.5e-3], [0.0, 37.0, 43.0, 43.0 + OIL * 1e-3]
BEEHIVE_D, BEEHIVE_F, BEEHIVE_DAMPER = [-1e-3, 0.0, 5e-3, 10e-3], [230.0, 250.0, 420.0, 640.0], 20.0
SLIP, STICKING = 15.0, 1.0e6
GAS_DEG, GAS_N = [-180.0, -70.0, -60.0, -40.0, 0.0, 180.0], [0.0, 0.0, -120.0, -60.0, 0.0, 0.0]
APART, PRESSED, PUSHING = range(3)
BETWEEN, SEATED, REFILL = range(3)
STICK, FORWARD, BACK = range(3)


class RealTrain:
    """The train in one set of modes: cam, seat, oil, friction; y is x, v of tappet and valve, z of friction and oil."""

    def __init__(self, lift, omega):
        self.lift, self.omega = lift, omega
        self.modes = {"cam": PUSHING, "seat": PUSHING, "oil": SEATED, "friction": STICK, "corner": 1}

    def laws(self, t, y):
        """Elastic and whole forces of the contacts, lengths and rates of all elements."""
        angle = self.omega * t - np.pi
        s, rate = float(self.lift(angle)), float(self.lift(angle, 1)) * self.omega
        d, v = s - y[0], rate - y[2]
        return {
            "cam": (CAM * d, CAM * d + CAM_DAMPER * v),
            "seat": (SEAT_PRELOAD - SEAT * y[1], SEAT_PRELOAD - SEAT * y[1] - SEAT_DAMPER * y[3]),
            "lifter": (y[0] - y[1], y[2] - y[3]),
            "guide": (-y[1], -y[3]),
            "gas": float(np.interp((np.degrees(angle) + 180.0) % 360.0 - 180.0, GAS_DEG, GAS_N)),
        }

    def __call__(self, t, y):
        law, mode = self.laws(t, y), self.modes
        d, v = law["lifter"]
        cam, seat = (law[name][1] if mode[name] == PUSHING else 0.0 for name in ("cam", "seat"))
        oil = OIL * (d - y[5] - TRAVEL) if mode["oil"] == SEATED else 0.0
        lifter = max(0.0, on_lines(d, PLUNGER_D, PLUNGER_F)) + oil
        spring = on_lines(y[1], BEEHIVE_D, BEEHIVE_F) + BEEHIVE_DAMPER * y[3]
        rub = {STICK: STICKING * (law["guide"][0] - y[4]), FORWARD: SLIP, BACK: -SLIP}[mode["friction"]]
        return np.array(
            [
                y[2],
                y[3],
                (cam - lifter) / TAPPET,
                (lifter - spring + seat + rub + law["gas"]) / VALVE,
                0.0 if mode["friction"] == STICK else law["guide"][1],
                {BETWEEN: 0.0, SEATED: oil / LEAK, REFILL: v}[mode["oil"]],
            ]
        )

    def watched(self):
        """(element, the mode that follows, what turns negative) for all that may switch, and the corners of tables."""
        mode, found = self.modes, []
        for name in ("cam", "seat"):
            elastic, whole = (lambda t, y, n=name, i=i: self.laws(t, y)[n][i] for i in range(2))
            if mode[name] == APART:
                found.append((name, PUSHING, negative(elastic)))
            elif mode[name] == PUSHING:
                found.append((name, PRESSED, whole))
            else:
                found += [(name, PUSHING, negative(whole)), (name, APART, elastic)]
        stretch, rate = lambda t, y: y[0] - y[1] - y[5], lambda t, y: y[2] - y[3]
        if mode["oil"] == BETWEEN:
            found += [("oil", SEATED, lambda t, y: TRAVEL - stretch(t, y)), ("oil", REFILL, stretch)]
        elif mode["oil"] == SEATED:
            found.append(("oil", BETWEEN, lambda t, y: stretch(t, y) - TRAVEL))
        else:
            found.append(("oil", BETWEEN, negative(rate)))
        rub, slide = lambda t, y: STICKING * (-y[1] - y[4]), lambda t, y: -y[3]
        if mode["friction"] == STICK:
            found += [
                ("friction", FORWARD, lambda t, y: SLIP - rub(t, y)),
                ("friction", BACK, lambda t, y: SLIP + rub(t, y)),
            ]
        else:
            found.append(("friction", STICK, slide if mode["friction"] == FORWARD else negative(slide)))
        line = mode["corner"]  # of the table spring: the one that begins at this row
        if line > 0:
            found.append(("corner", line - 1, lambda t, y: y[1] - BEEHIVE_D[line]))
        if line < len(BEEHIVE_D) - 2:
            found.append(("corner", line + 1, lambda t, y: BEEHIVE_D[line + 1] - y[1]))
        return found


def on_lines(d, places, forces):
    """Straight lines through rows, of which the outer two go on."""
    i = min(max(int(np.searchsorted(places, d)) - 1, 0), len(places) - 2)
    return forces[i] + (forces[i + 1] - forces[i]) / (places[i + 1] - places[i]) * (d - places[i])


def negative(function):
    return lambda t, y: -function(t, y)


def located(lift, omega, start, angles, rtol=1e-12):
    """States (len(angles), 6) at cam angles [rad] of the first revolution from `start`, and how often each switched."""
    train, y, t, end = RealTrain(lift, omega), np.array(start), 0.0, 2 * np.pi / omega
    corners = np.union1d((lift.borders[1:-1] + np.pi) / omega, (np.radians(GAS_DEG[1:-1]) + np.pi) / omega)
    wanted, count = (angles + np.pi) / omega, dict.fromkeys(train.modes, 0)
    result = np.tile(np.asarray(start), (len(angles), 1))
    while t < end:
        stop = next((c for c in corners if c > t * (1 + 1e-14) + 1e-16), end)
        watched, events = train.watched(), []
        for _, _, function in watched:
            events.append(lambda t, y, f=function: f(t, y))
            events[-1].terminal, events[-1].direction = True, -1
        solution = solve_ivp(
            train, (t, stop), y, "DOP853", rtol=rtol, atol=1e-15, max_step=2e-5, dense_output=True, events=events
        )
        inside = (wanted > t) & (wanted <= solution.t[-1])
        if inside.any():
            result[inside] = solution.sol(wanted[inside]).T
        t, y = solution.t[-1], solution.y[:, -1]
        if solution.status == 1:
            name, mode, _ = watched[next(j for j, times in enumerate(solution.t_events) if len(times))]
            count[name] += 1
            train.modes[name] = mode
    return result, count
