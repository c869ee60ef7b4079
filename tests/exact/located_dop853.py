"""An independent reference for tests: SciPy's DOP853 with every contact switching located, from the scene file itself.

Shares no code with the package beyond the scene's numbers and the lift's values: own assembly, own contact states.
"""

import numpy as np
from scipy.integrate import solve_ivp

APART, PRESSED, PUSHING = range(3)


def located_dop853(scene, lift, speed_rpm, angles, start, rtol=1e-12, max_step=1e-5):
    """Positions (len(angles), n) [m] at cam angles [rad] of the first revolution, from positions `start` at rest."""
    omega = speed_rpm * scene.operation.cam_per_crank * np.pi / 30
    n = len(scene.mass)
    index = {m.name: i for i, m in enumerate(scene.mass)}
    inverse_mass = np.array([1 / m.mass_kg for m in scene.mass])
    ground = np.array([m.damping_N_s_per_m for m in scene.mass])
    constant = np.array([m.force_N for m in scene.mass])
    rows = np.zeros((len(scene.element), n))
    for row, e in zip(rows, scene.element, strict=True):
        for end, sign in zip(e.between, (1.0, -1.0), strict=True):
            if end != "ground":
                row[index[end]] = sign
    k = np.array([e.stiffness_N_per_m for e in scene.element])
    c = np.array([e.damping_N_s_per_m for e in scene.element])
    preload = np.array([e.preload_N for e in scene.element])
    gap = np.array([e.gap_mm for e in scene.element]) * 1e-3
    driven = np.array([float(e.cam_driven) for e in scene.element])
    contacts = [i for i, e in enumerate(scene.element) if e.kind == "contact"]

    def laws(t, y):
        theta = omega * t - np.pi
        d = rows @ y[:n] - gap + driven * float(lift(theta))
        rate = rows @ y[n:] + driven * omega * float(lift(theta, 1))
        return preload + k * d, preload + k * d + c * rate

    def motion(states):
        acts = np.array([states.get(i, PUSHING) == PUSHING for i in range(len(k))])

        def rhs(t, y):
            force = np.where(acts, laws(t, y)[1], 0.0)
            return np.concatenate([y[n:], inverse_mass * (constant - ground * y[n:] - rows.T @ force)])

        return rhs

    def switches(states):
        found = []
        for i in contacts:
            if states[i] == APART:
                found.append((i, PUSHING, 0, 1.0))
            elif states[i] == PUSHING:
                found.append((i, PRESSED if c[i] > 0 else APART, 1, -1.0))
            else:
                found += [(i, PUSHING, 1, 1.0), (i, APART, 0, -1.0)]
        return found

    def watcher(i, law, direction):
        def watch(t, y):
            return laws(t, y)[law][i]

        watch.terminal, watch.direction = True, direction
        return watch

    y, t, end = np.concatenate([start, np.zeros(n)]), 0.0, 2 * np.pi / omega
    states = {i: PUSHING if preload[i] + k[i] * (rows[i] @ start - gap[i]) > 0 else APART for i in contacts}
    borders = [*((lift.borders[1:-1] + np.pi) / omega), end]
    wanted = (np.asarray(angles) + np.pi) / omega
    result = np.full((len(wanted), n), np.nan)
    result[wanted == 0.0] = start
    while t < end:
        stop = next(b for b in borders if b > t * (1 + 1e-14) + 1e-16)
        watched = switches(states)
        solution = solve_ivp(
            motion(states),
            (t, stop),
            y,
            "DOP853",
            rtol=rtol,
            atol=1e-16,
            max_step=max_step,
            dense_output=True,
            events=[watcher(i, law, direction) for i, _, law, direction in watched],
        )
        inside = (wanted > t) & (wanted <= solution.t[-1])
        if inside.any():
            result[inside] = solution.sol(wanted[inside])[:n].T
        t, y = solution.t[-1], solution.y[:, -1]
        if solution.status == 1:
            fired = next(j for j, times in enumerate(solution.t_events) if len(times))
            states[watched[fired][0]] = watched[fired][1]
    return result
