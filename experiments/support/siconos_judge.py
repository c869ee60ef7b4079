"""The motion of an undamped train by Siconos, an engine that formulates contact as complementarity, from a file of
numbers.

    python3 siconos_judge.py GIVEN.json --out motion.json

It runs with an interpreter that has Siconos (Debian's `python3-siconos` installs it for the system's Python), and
imports nothing of camopt. Its input file is written by `experiments.support.undamped`: the train, its state at rest and
the pieces of the lift as `camopt.verifier.outside` reads them from scene and design, in SI units and radians.

Siconos (Acary and Brogliato 2008, Numerical methods for nonsmooth dynamical systems) gets a linear system x' = A x + b
+ B f for positions and velocities x, and for the forces f of the contacts the complementarity 0 <= f, 0 <= y = C x + f
/ k + e, f y = 0: a contact either pushes like its spring or is open. A contact with a damper has no such form, which is
why the trains have none here. One revolution from rest is computed in equal steps by the trapezoidal rule
(EulerMoreauOSI with theta and gamma of 1/2) and a linear complementarity problem in each; no switching is located. The
step is halved until the valve position has converged.
"""

import argparse
import json
import math
import time
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

NM = 1e-9
SAMPLES = 720
"""Number of equal parts of the revolution at whose ends the valve position is recorded."""
COARSEST, FINEST = 28_800, 460_800
"""First and last number of steps of the revolution, multiples of SAMPLES."""
STANDS_NM = 2.0
"""The valve has converged if each of two halvings moves it by less than this [nm]; one may do so by chance."""


def lift_of(cam: dict, angle: np.ndarray) -> np.ndarray:
    """Lift (k) [m] at angles (k) [rad] by the `start` [rad] of its pieces and their `coefficients` [m/rad^k]."""
    start, lift = np.array(cam["start"]), np.zeros_like(angle)
    which = np.clip(np.searchsorted(start, angle, "right") - 1, 0, len(start) - 1)
    for i, coefficients in enumerate(cam["coefficients"]):
        here = which == i
        lift[here] = np.polynomial.polynomial.polyval(angle[here] - start[i], coefficients)
    return lift


class SiconosModel:
    """A train with a cam at one cam speed [rad/s]."""

    def __init__(self, data: dict, cam_speed: float):
        self.given, self.speed = data, cam_speed
        masses, drag, load = (np.array(data[name]) for name in ("mass", "drag", "load"))
        s, c = (SimpleNamespace(**{k: np.array(v) for k, v in data[kind].items()}) for kind in ("springs", "contacts"))
        n, m = len(masses), masses[:, None]
        s.row, c.row = (group.row.reshape(-1, n) for group in (s, c))  # a train may have no spring
        stiff = s.row.T @ (s.stiffness[:, None] * s.row)
        damped = s.row.T @ (s.damping[:, None] * s.row) + np.diag(drag)
        self.a = np.block([[np.zeros((n, n)), np.eye(n)], [-stiff / m, -damped / m]])
        held = load - s.row.T @ (s.preload - s.stiffness * s.gap)
        self.b = np.concatenate([np.zeros(n), held / masses])
        self.by_force = np.vstack([np.zeros((n, len(c.gap))), -c.row.T / m])
        self.by_state = np.hstack([-c.row, np.zeros_like(c.row)])
        self.stiffness, self.driven, self.open = c.stiffness, c.driven, c.gap - c.preload / c.stiffness
        self.start = np.concatenate([data["rest"], np.zeros(n)])

    def revolution(self, steps: int) -> np.ndarray:
        """Valve position (SAMPLES + 1) [m] in the first revolution from rest, in equal steps."""
        sk: Any = import_module("siconos.kernel")
        period, at = 2 * math.pi / self.speed, self.given["valve"]
        system = sk.FirstOrderLinearTIDS(self.start, self.a, self.b)
        relation = sk.FirstOrderLinearTIR(self.by_state, self.by_force)
        relation.setDPtr(np.diag(1.0 / self.stiffness))
        relation.setePtr(self.open.copy())
        law = sk.ComplementarityConditionNSL(len(self.open))
        model = sk.NonSmoothDynamicalSystem(0.0, period)
        model.insertDynamicalSystem(system)
        model.link(sk.Interaction(law, relation), system)
        rule = sk.EulerMoreauOSI(0.5)
        rule.setUseGamma(True)
        rule.setGamma(0.5)
        run = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, period / steps), rule, sk.LCP())
        run.initialize()
        # the rule uses the mean force of a step's two ends, and Siconos would start with zero
        pushing = np.maximum(0.0, -self.stiffness * (self.by_state @ self.start + self.open))
        system.setR(self.by_force @ pushing)
        system.swapInMemory()
        opened, forced = self._along(steps)
        e, b, every, valve = relation.e(), system.b(), steps // SAMPLES, [self.start[at]]
        for i in range(1, steps + 1):
            e[:], b[:] = opened[i], forced[i - 1]  # views of what Siconos reads
            run.computeOneStep()
            run.nextStep()
            if i % every == 0:
                valve.append(system.x()[at])
        return np.array(valve)

    def _along(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Opening of the contacts (steps + 1, e) [m] at x = 0, and b (steps, 2 n) as its mean over each step."""
        angle, masses = np.linspace(-math.pi, math.pi, steps + 1), self.given["mass"]
        opened = self.open - lift_of(self.given["cam"], angle)[:, None] * self.driven
        forced = np.tile(self.b, (steps + 1, 1))
        for on, table in self.given["forcing"]:
            forced[:, len(masses) + on] += np.interp(angle, *np.transpose(table)) / masses[on]
        return opened, (forced[1:] + forced[:-1]) / 2


def halved(model: SiconosModel, finest: int) -> list[dict]:
    """A record for each number of steps, which is doubled until the valve has converged or `finest` is reached."""
    records: list[dict] = []
    steps, moved_nm = COARSEST, [math.inf, math.inf]
    while steps <= finest and max(moved_nm[-2:]) > STANDS_NM:
        begin = time.process_time()
        valve = model.revolution(steps)
        seconds = time.process_time() - begin
        if records:
            moved_nm.append(float(np.abs(valve - records[-1]["valve_m"]).max()) / NM)
        records.append({"steps": steps, "seconds": seconds, "valve_m": valve.tolist()})
        steps *= 2
    return records


def main() -> None:
    """Writes the motions at all speeds as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("given", help="the JSON file of numbers")
    parser.add_argument("--out", required=True, help="the JSON file to write")
    args = parser.parse_args()
    data, rows = json.loads(Path(args.given).read_text(encoding="utf-8")), []
    for speed_rpm, cam_speed in data["speeds"]:
        model = SiconosModel(data, cam_speed)
        turn_s = 2 * math.pi / cam_speed
        rows.append({"speed_rpm": speed_rpm, "turn_s": turn_s, "halvings": halved(model, data["finest"])})
    content = {"engine": f"Siconos {import_module('siconos').version}", "speeds": rows}
    Path(args.out).write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    main()
