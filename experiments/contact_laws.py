"""How do bounce and jump depend on which of three laws of a damped contact is used?

A contact of a spring and a damper in parallel pushes with p + c d' while it is compressed. The three laws differ where
the damper would pull more than the spring pushes: camopt's contact then has no force ("never pulls"); with the printed
criterion of Kodama et al. and in Exudyn's own contact the force pulls until the spring is unloaded ("may pull");
Modelica's ElastoGap limits the damper's force to that of the spring, also while the contact closes ("damping up to
spring"). Exudyn computes all three on the same train and cam. Bounce and jump are ranges over a number of revolutions
after the start-up transient.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from camopt.cam.design_file import as_written
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.scene import Scene, load_scene
from camopt.verifier.from_outside import outside_motions
from camopt.verifier.outside.forces import LAWS_OF_CONTACT
from experiments.outside_judges import delivered, needed
from experiments.support.record import RESULTS, printed, run_script, write_result

CASES = (
    ("kodama", "design", 7000.0),
    ("kodama", "polydyne", 7000.0),
    ("pushrod-5mass", "polydyne", 5000.0),
    ("exhaust-gas", "polydyne", 6000.0),
)
"""Scene, cam, crankshaft speed [r/min]; the last two trains have numbers from the literature."""
SMALL = (("motori-1", "polydyne", 6000.0),)
BEFORE, MEASURED = {"small": 4, "full": 40}, {"small": 2, "full": 40}
FIGURES = "bounce_mm", "jump_mm", "seating_velocity_m_per_s"


def main(size: str = "full", folder=RESULTS) -> dict:
    """Computes a row for each case and law, and writes `contact_laws.json`."""
    rows = []
    with TemporaryDirectory() as made:
        for name, cam, speed_rpm in CASES if size == "full" else SMALL:
            scene = load_scene(name)
            lift = needed(delivered(scene, Path(made))) if cam == "design" else polydyne(scene)
            for law in LAWS_OF_CONTACT:
                of = {"scene": name, "cam": cam, "speed_rpm": speed_rpm, "law": law}
                rows.append(printed(of | ranges(scene, as_written(lift), speed_rpm, law, BEFORE[size], MEASURED[size])))
    content = {"rows": rows, "before": BEFORE[size], "measured": MEASURED[size]}
    return write_result("contact_laws", size, content, {}, folder)


def ranges(scene: Scene, lift: Lift, speed_rpm: float, law: str, before: int, measured: int) -> dict:
    """Smallest and largest value of every figure over the measured revolutions, None where the valve never seats."""
    options = "--law", law, "--settled", str(before), "--measured", str(measured), "--finest", "1e-8"
    revolutions = outside_motions(scene, lift, [speed_rpm], *options)["speeds"][0]["settled"]
    values = {name: np.array([f[name] for f in revolutions if f[name] is not None]) for name in FIGURES}
    return {name: [float(v.min()), float(v.max())] if len(v) else None for name, v in values.items()}


if __name__ == "__main__":
    run_script(main, __doc__)
