"""The motion of an undamped train by Siconos, an engine that poses contact as complementarity, from two files alone.

    python3 siconos_judge.py SCENE.toml DESIGN.json --speeds 5000 6000 --out motion.json

It runs with the interpreter that has Siconos (Debian's `python3-siconos` belongs to the system's), and imports nothing
of camopt: how it reads `scene.toml` and `design.json`, and its state at rest, are its own.

Siconos (Acary and Brogliato 2008, Numerical methods for nonsmooth dynamical systems) gets a linear system
x' = A x + b + B f for positions and velocities x, and for the forces f of the contacts the complementarity
0 <= f, 0 <= y = C x + f / k + e, f y = 0: a contact either pushes as its spring does or is open. A contact with a
damper has no such form, which is why trains are judged here without any. One revolution from rest is taken in equal
steps by the trapezoidal rule (EulerMoreauOSI with theta and gamma of 1/2) and a linear complementarity problem in
each; no switching is located. The step is halved until the valve stands.
"""

import argparse
import json
import math
import sys
import time
import tomllib
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

MM, DEG, RPM, NM = 1e-3, math.pi / 180.0, math.pi / 30.0, 1e-9
SAMPLES = 720
"""Equal parts of the revolution at whose ends the valve is recorded."""
COARSEST, FINEST = 28_800, 460_800
"""Steps of the revolution, from the first to the last: multiples of SAMPLES."""
STANDS_NM = 2.0
"""The valve stands where two halvings of the step move it by less than this [nm] each: one may do so by chance."""


class Refused(ValueError):
    """What cannot be expressed as complementarity; the text is one sentence."""


@dataclass(frozen=True)
class Parts:
    """Elements of one kind: row (e, n) of signs by mass, and numbers (e) in SI."""

    row: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    preload: np.ndarray
    gap: np.ndarray
    driven: np.ndarray


@dataclass(frozen=True)
class Train:
    """Masses (n) [kg], their drag (n) [N s/m] and load (n) [N], springs, contacts, and forces by the cam angle."""

    mass: np.ndarray
    drag: np.ndarray
    load: np.ndarray
    springs: Parts
    contacts: Parts
    forcing: list[tuple[int, np.ndarray]]
    valve: int
    cam_per_crank: float


def read_train(path: str) -> Train:
    """The train of a scene file. Raises Refused for laws that are not linear, memories, and contacts with dampers."""
    scene = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    names = [m["name"] for m in scene["mass"]]
    for e in scene["element"]:
        if e["kind"] not in ("spring", "contact") or e.get("law", "linear") != "linear":
            raise Refused(f"Siconos cannot express {e['name']}: it is given linear springs and contacts alone")
        if e["kind"] == "contact" and e.get("damping_N_s_per_m", 0.0):
            raise Refused(f"Siconos cannot express the damper of the contact {e['name']}: give a train without")
        if e["kind"] == "spring" and e.get("cam_driven"):
            raise Refused(f"Siconos cannot express {e['name']}: the cam must drive a contact")

    def of_kind(kind: str) -> Parts:
        some = [e for e in scene["element"] if e["kind"] == kind]
        row = np.zeros((len(some), len(names)))
        for signs, e in zip(row, some, strict=True):
            for end, sign in zip(e["between"], (1.0, -1.0), strict=True):
                if end != "ground":
                    signs[names.index(end)] = sign
        keys = "stiffness_N_per_m", "damping_N_s_per_m", "preload_N", "gap_mm", "cam_driven"
        k, c, preload, gap, driven = (np.array([float(e.get(key, 0.0)) for e in some]) for key in keys)
        return Parts(row, k, c, preload, gap * MM, driven)

    mass, drag, load = (
        np.array([m.get(key, 0.0) for m in scene["mass"]]) for key in ("mass_kg", "damping_N_s_per_m", "force_N")
    )
    forcing = [(names.index(f["on"]), np.array(f["table"])) for f in scene.get("force", [])]
    valve, per_crank = names.index(scene["valve"]), scene["operation"].get("cam_per_crank", 0.5)
    return Train(mass, drag, load, of_kind("spring"), of_kind("contact"), forcing, valve, per_crank)


def lift_of(path: str, angle_deg: np.ndarray) -> np.ndarray:
    """Lift (k) [m] at ascending angles (k) [deg] of a design file."""
    pieces = json.loads(Path(path).read_text(encoding="utf-8"))["pieces"]
    start, lift = np.array(pieces["start_deg"]), np.zeros_like(angle_deg)
    which = np.clip(np.searchsorted(start, angle_deg, "right") - 1, 0, len(start) - 1)
    for i, coefficients in enumerate(pieces["coefficients_mm"]):
        here = which == i
        lift[here] = np.polynomial.polynomial.polyval(angle_deg[here] - start[i], coefficients)
    return lift * MM


def at_rest(train: Train) -> np.ndarray:
    """Positions (n) [m] on the base circle: Newton's method on the forces, shortened where a step overshoots."""
    s, c = train.springs, train.contacts
    row, k = np.vstack([s.row, c.row]), np.concatenate([s.stiffness, c.stiffness])
    held = np.concatenate([s.preload - s.stiffness * s.gap, c.preload - c.stiffness * c.gap])
    may_pull = np.arange(len(k)) < len(s.gap)

    def left(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        force = held + k * (row @ x)
        acts = may_pull | (force > 0.0)
        return train.load - row.T @ (force * acts), acts

    x = np.zeros(len(train.mass))
    for _ in range(100):
        residual, acts = left(x)
        if np.abs(residual).max() < 1e-9 * np.abs(held).max():
            return x
        stiff = row.T @ ((k * acts)[:, None] * row)
        step = np.linalg.solve(stiff + 1e-12 * k.max() * np.eye(len(x)), residual)
        while left(x + step)[0] @ step < -0.1 * abs(residual @ step):  # the energy is convex
            step = step / 2
        x = x + step
    raise Refused("Siconos has no state at rest to begin from: no forces balance on the base circle")


class SiconosModel:
    """A train under a cam at one cam speed [rad/s]."""

    def __init__(self, train: Train, design: str, cam_speed: float):
        self.train, self.design, self.speed = train, design, cam_speed
        s, c, n, m = train.springs, train.contacts, len(train.mass), train.mass[:, None]
        stiff = s.row.T @ (s.stiffness[:, None] * s.row)
        damped = s.row.T @ (s.damping[:, None] * s.row) + np.diag(train.drag)
        self.a = np.block([[np.zeros((n, n)), np.eye(n)], [-stiff / m, -damped / m]])
        held = train.load - s.row.T @ (s.preload - s.stiffness * s.gap)
        self.b = np.concatenate([np.zeros(n), held / train.mass])
        self.by_force = np.vstack([np.zeros((n, len(c.gap))), -c.row.T / m])
        self.by_state = np.hstack([-c.row, np.zeros_like(c.row)])
        self.open = c.gap - c.preload / c.stiffness
        self.start = np.concatenate([at_rest(train), np.zeros(n)])

    def revolution(self, steps: int) -> np.ndarray:
        """Valve position (SAMPLES + 1) [m] in the first revolution from rest, in equal steps."""
        sk: Any = import_module("siconos.kernel")
        contacts, period = self.train.contacts, 2 * math.pi / self.speed
        system = sk.FirstOrderLinearTIDS(self.start, self.a, self.b)
        relation = sk.FirstOrderLinearTIR(self.by_state, self.by_force)
        relation.setDPtr(np.diag(1.0 / contacts.stiffness))
        relation.setePtr(self.open.copy())
        law = sk.ComplementarityConditionNSL(len(contacts.gap))
        model = sk.NonSmoothDynamicalSystem(0.0, period)
        model.insertDynamicalSystem(system)
        model.link(sk.Interaction(law, relation), system)
        rule = sk.EulerMoreauOSI(0.5)
        rule.setUseGamma(True)
        rule.setGamma(0.5)
        run = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, period / steps), rule, sk.LCP())
        run.initialize()
        # the rule takes the mean force of a step's two ends, and Siconos would begin with none
        pushing = np.maximum(0.0, -contacts.stiffness * (self.by_state @ self.start + self.open))
        system.setR(self.by_force @ pushing)
        system.swapInMemory()
        opened, forced = self._along(steps)
        e, b, every, valve = relation.e(), system.b(), steps // SAMPLES, [self.start[self.train.valve]]
        for i in range(1, steps + 1):
            e[:], b[:] = opened[i], forced[i - 1]  # views of what Siconos reads
            run.computeOneStep()
            run.nextStep()
            if i % every == 0:
                valve.append(system.x()[self.train.valve])
        return np.array(valve)

    def _along(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """How far the contacts are open (steps + 1, e) [m] at x = 0, and b (steps, 2 n) as its mean over each step."""
        angle, n = np.linspace(-180.0, 180.0, steps + 1), len(self.train.mass)
        opened = self.open - lift_of(self.design, angle)[:, None] * self.train.contacts.driven
        forced = np.tile(self.b, (steps + 1, 1))
        for on, table in self.train.forcing:
            forced[:, n + on] += np.interp(angle, *table.T) / self.train.mass[on]
        return opened, (forced[1:] + forced[:-1]) / 2


def halved(model: SiconosModel, finest: int) -> list[dict]:
    """A record for each number of steps, twice as many as before, until the valve stands or `finest` is reached."""
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


def main() -> int:
    """Writes the motions at all speeds as JSON; exit code 2 with a sentence for what cannot be expressed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("design")
    parser.add_argument("--speeds", type=float, nargs="+", required=True, help="of the crankshaft [r/min]")
    parser.add_argument("--out", required=True, help="the JSON file to write")
    parser.add_argument("--finest", type=int, default=FINEST, help="most steps of the revolution")
    args = parser.parse_args()
    rows = []
    try:
        train = read_train(args.scene)
        for speed_rpm in args.speeds:
            model = SiconosModel(train, args.design, speed_rpm * RPM * train.cam_per_crank)
            turn_s = 2 * math.pi / model.speed
            rows.append({"speed_rpm": speed_rpm, "turn_s": turn_s, "halvings": halved(model, args.finest)})
    except Refused as error:
        print(error, file=sys.stderr)
        return 2
    content = {"engine": f"Siconos {import_module('siconos').version}", "speeds": rows}
    Path(args.out).write_text(json.dumps(content), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
