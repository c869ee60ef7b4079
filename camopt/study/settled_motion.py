"""The energy balance of a verdict's settled motions, and whether each is a stable periodic solution: for the first
method of the verdict, at every listed speed, from the state in which the motion settled."""

import numpy as np

from camopt.cam.lift import Lift
from camopt.measure.energy import energy
from camopt.measure.periodic import periodic_state
from camopt.scene import Response, Train, build_train
from camopt.scene.response import Revolve
from camopt.scene.units import UM
from camopt.verifier.convergence import Converged
from camopt.verifier.verdict import Verdict, method_named

SAMPLES = 7200
"""Least number of samples per revolution, with which the energy balance of event-exact motion closes to 1e-9."""


def settled_records(lift: Lift, verdict: Verdict, *, with_energy: bool, with_periodic: bool) -> list[dict]:
    """The additions to each of the `speeds` of verification.json: `energy` and `periodic_solution`, where requested;
    None at a speed at which the method refused the motion."""
    assert verdict.scene is not None, "a verdict knows its scene"
    train, records = build_train(verdict.scene), []
    for speed in verdict.speeds:
        name, answer = next(iter(speed.methods.items()))
        prepare, steps = method_named(name), max(answer.steps_per_revolution, SAMPLES)
        revolve = prepare(train, lift, verdict.scene.cam_speed(speed.speed_rpm), steps)
        record = {}
        if with_energy:
            record["energy"] = None if answer.state is None else energy_record(revolve(answer.state), lift)
        if with_periodic:
            record["periodic_solution"] = None if answer.state is None else periodic_record(train, revolve, answer)
        records.append(record)
    return records


def energy_record(response: Response, lift: Lift) -> dict[str, float]:
    """The energy balance of a motion [J]: put in = dissipated + left in contacts + change + residual."""
    balance = energy(response, lift)
    return {
        "put_in_J": balance.put_in,
        "dissipated_J": balance.dissipated,
        "left_in_contacts_J": float(balance.left.sum()),
        "change_J": float(balance.stored[-1] - balance.stored[0]),
        "residual_J": balance.residual,
        "residual_relative": balance.residual_relative,
    }


def periodic_record(train: Train, revolve: Revolve, answer: Converged) -> dict:
    """Whether a stable periodic solution lies near a settled motion, its distance, and its Floquet multipliers."""
    assert answer.state is not None
    solution, n = periodic_state(revolve, answer.state, memories=len(train.memory)), len(train.mass)
    distance = float(np.abs(solution.state - answer.state)[:n].max()) if solution.periodic else None
    multipliers = sorted(solution.multipliers, key=abs, reverse=True)
    return {
        "stable": solution.periodic,
        "distance_um": None if distance is None else distance / UM,
        "largest_multiplier": solution.radius if len(multipliers) else None,
        "multipliers": [[float(m.real), float(m.imag)] for m in multipliers],
    }


def settled_lines(verdict: Verdict, records: list[dict]) -> list[str]:
    """The records of `settled_records` as text, a line for each speed and each record."""
    lines = []
    for speed, record in zip(verdict.speeds, records, strict=True):
        at = f"{speed.speed_rpm:g} r/min"
        if balance := record.get("energy"):
            lines.append(
                f"{at}: {balance['put_in_J']:.4g} J put in, {balance['dissipated_J']:.4g} J dissipated, "
                f"{balance['left_in_contacts_J']:.4g} J left in opened contacts; "
                f"the balance closes to {abs(balance['residual_relative']):.1e} of the largest stored energy"
            )
        if solution := record.get("periodic_solution"):
            near = f"{solution['distance_um']:.2g} um from the settled motion" if solution["stable"] else "not stable"
            largest = solution["largest_multiplier"]
            size = "no periodic solution found" if largest is None else f"largest Floquet multiplier {largest:.4f}"
            lines.append(f"{at}: {size}" + ("" if largest is None else f", the periodic solution is {near}"))
    return lines
