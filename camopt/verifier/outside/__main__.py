"""`python -m camopt.verifier.outside SCENE.toml DESIGN.json --speeds 5000 6000 --out motion.json`.

From rest at every speed, the valve's position at equal angles of the first revolutions. The tolerance of the solver is
tightened tenfold until these positions stand, and what the last tightening moved is the judge's own error estimate.
With `--settled`, also the figures of `--measured` revolutions after so many.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from camopt.verifier.outside.engine import ExudynModel, FiledMotion, exu
from camopt.verifier.outside.figures import figures, hermite
from camopt.verifier.outside.filed import FiledCam, FiledTrain, OutsideRefused, read_cam, read_train
from camopt.verifier.outside.forces import LAWS_OF_CONTACT

COARSEST, FINEST = 1e-8, 1e-11
"""First and last relative tolerance of the solver. Below the last one its shortest steps reach round-off."""
STANDS_NM = 0.3
"""The valve's motion has converged if a tenfold smaller tolerance changes it by less than this [nm]."""
SETTLED = 1e-9
"""Relative tolerance for settled motions, whose metrics are compared to within 1e-4 mm."""
NM = 1e-9


def main(arguments: list[str] | None = None) -> int:
    """Write the motions at all speeds as JSON; exit code 2, with a sentence, if the scene cannot be expressed."""
    args = _parser().parse_args(arguments)
    try:
        train, cam = read_train(args.scene), read_cam(args.design)
        settled = args.settled or [None] * len(args.speeds)
        rows = [_at_speed(train, cam, args, *case) for case in zip(args.speeds, settled, strict=True)]
    except OutsideRefused as error:
        print(error, file=sys.stderr)
        return 2
    Path(args.out).write_text(json.dumps({"engine": f"Exudyn {exu.__version__}", "speeds": rows}), encoding="utf-8")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m camopt.verifier.outside", description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("design")
    parser.add_argument("--speeds", type=float, nargs="+", required=True, help="of the crankshaft [r/min]")
    parser.add_argument("--out", required=True, help="the JSON file to write")
    parser.add_argument("--revolutions", type=int, default=2, help="from rest, whose valve motion is recorded")
    parser.add_argument("--samples", type=int, default=720, help="equal parts of a revolution")
    parser.add_argument("--settled", type=int, nargs="+", help="by speed: revolutions before those that are measured")
    parser.add_argument("--measured", type=int, default=4, help="revolutions whose figures are read then")
    parser.add_argument("--finest", type=float, default=FINEST, help="the last tolerance")
    parser.add_argument("--law", choices=LAWS_OF_CONTACT, default=LAWS_OF_CONTACT[0], help="what contacts do")
    return parser


def _at_speed(train: FiledTrain, cam: FiledCam, args: argparse.Namespace, speed_rpm: float, settled: int | None):
    """The record of one speed."""
    speed, tolerance = train.cam_speed(speed_rpm), COARSEST
    angles = np.linspace(-np.pi, np.pi, args.samples + 1)

    def simulated(tolerance: float) -> tuple[list[FiledMotion], np.ndarray, float]:
        begin = time.process_time()
        motions = _from_rest(ExudynModel(train, cam, speed, tolerance, args.law), args.revolutions + 1)
        seconds = (time.process_time() - begin) / len(motions)
        valve = [hermite(m.angle, m.x, m.v / speed, angles)[0][:, train.valve] for m in motions[:-1]]
        return motions, np.array(valve), seconds

    motions, valve, seconds = simulated(tolerance)
    moved = np.full(args.revolutions, np.inf)
    while moved.max() > STANDS_NM * NM and tolerance > 1.5 * args.finest:
        tolerance, before = tolerance / 10, valve
        motions, valve, seconds = simulated(tolerance)
        moved = np.abs(valve - before).max(axis=1)
    row = {
        "speed_rpm": speed_rpm,
        "tolerance": tolerance,
        "moved_nm": (moved / NM).tolist(),
        "valve_m": valve.tolist(),
        "steps": len(motions[0].angle) - 1,
        "seconds_per_revolution": seconds,
        "figures": figures(train, cam, speed, motions, args.law),
    }
    if settled is not None:
        model = ExudynModel(train, cam, speed, max(SETTLED, args.finest), args.law)
        record = _from_rest(model, settled + args.measured + 1)[settled:]
        row["settled"] = figures(train, cam, speed, record, args.law)
    return row


def _from_rest(model: ExudynModel, revolutions: int) -> list[FiledMotion]:
    """Successive revolutions from rest."""
    state, motions = model.rest(), []
    for _ in range(revolutions):
        motions.append(model.revolve(state))
        state = motions[-1].end
    return motions


if __name__ == "__main__":
    sys.exit(main())
