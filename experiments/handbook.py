"""Does the pushrod train of the Cam Design Handbook have the masses and frequencies that the book prints?

Rothbart (editor), Cam Design Handbook, 2004, pages 349 and 353: the two-mass form at the cam. `pushrod-5mass` is the
same train on the valve's axis, with separate masses of stem and spring.
"""

import camopt
from camopt.scene import parse_scene
from camopt.study.modes import modes
from experiments.support.record import RESULTS, run_script, write_result

POUND, INCH = 0.45359237, 0.0254
POUND_PER_INCH = POUND * 9.80665 / INCH
RATIO = 1.7
TWO_MASSES = f"""
format = 1
name = "handbook"
[[mass]]
name = "cam_side"
mass_kg = {(0.270 + 0.114 / 2) * POUND}
[[mass]]
name = "valve_side"
mass_kg = {(0.114 / 2 + 0.132 / 0.875**2 + (0.251 + 0.153 / 3) * RATIO**2) * POUND}
[[element]]
name = "pushrod"
kind = "spring"
between = ["cam_side", "valve_side"]
stiffness_N_per_m = {3.0e5 * POUND_PER_INCH}
[[element]]
name = "spring"
kind = "spring"
between = ["valve_side", "ground"]
stiffness_N_per_m = {660 * POUND_PER_INCH}
"""
PRINTED = {"mass_lbm": (0.327, 1.10), "frequency_Hz": (67.0, 3400.0)}


def main(size: str, folder=RESULTS) -> dict:
    """Compares the printed masses and frequencies with those of the scene made from the printed parts."""
    scene = parse_scene(TWO_MASSES, "handbook")
    frequencies = modes(scene).frequency_Hz
    rows = [
        {"what": f"mass at the {m.name.replace('_', ' ')} [lbm]", "printed": printed, "camopt": m.mass_kg / POUND}
        for m, printed in zip(scene.mass, PRINTED["mass_lbm"], strict=True)
    ]
    rows += [
        {"what": f"frequency {number} [Hz]", "printed": printed, "camopt": float(hertz)}
        for number, (hertz, printed) in enumerate(zip(frequencies, PRINTED["frequency_Hz"], strict=True), 1)
    ]
    five = modes(camopt.load_scene("pushrod-5mass"), "lifted")
    return write_result("handbook", size, {"rows": rows}, {"modes": five.plot()}, folder)


if __name__ == "__main__":
    run_script(main, __doc__)
