"""The lines that a researcher was promised run as printed, but for a design speed that this family does not have.

The design prints `design_speed_rpm=3000`. Speeds are crankshaft r/min, and at 3000 the Polydyne of these exponents
would rise to 13 mm; 3000 camshaft r/min, as MOTORI 2004 counts, are 6000.
"""

import pytest

from camopt.scene import InputError

LINES = """
import camopt, optax

scene = camopt.load_scene("motori-1")
start = camopt.polydyne(scene, exponents=(2, 10, 18, 26, 34), design_speed_rpm=3000)
objective = camopt.objective(scene, speeds_rpm=(4000, 5000), maximise="area_ratio",
                             penalties={"bounce_mm": 1.0, "jump_mm": 1.0}, path="smooth")
history = camopt.ascend(objective, start, optax.adam(1e-3), steps=50)
history.plot(); camopt.verify(scene, history.best)
"""


def with_changes(**changes: str) -> str:
    """The lines with a working design speed and other words in place of those printed."""
    printed = {"speed": "design_speed_rpm=3000", "path": 'path="smooth"', "optimiser": "optax.adam(1e-3)"}
    printed |= {"steps": "steps=50", "verify": "camopt.verify(scene, history.best)"}
    text = LINES
    for name, words in ({"speed": "design_speed_rpm=6000"} | changes).items():
        assert printed[name] in text
        text = text.replace(printed[name], words)
    return text


def run(text: str) -> dict:
    names: dict = {}
    exec(text, names)
    return names


def test_the_printed_design_speed_is_refused_with_a_remedy():
    with pytest.raises(InputError, match=r"would rise to 13.24 mm .* try a higher speed_rpm"):
        run(LINES)


def test_some_steps_from_the_promised_start():
    names = run(with_changes(path='path="exact"', steps="steps=4", verify="history"))
    assert names["history"].dataset.sizes["step"] == 5 and names["history"].confirmed


@pytest.mark.long
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("optimiser", ["optax.adam(1e-3)", "optax.lbfgs()"])
@pytest.mark.parametrize("path", ["smooth", "exact"])
def test_in_full(path, optimiser):
    names = run(with_changes(path=f'path="{path}"', optimiser=optimiser))
    assert names["history"].dataset.sizes["step"] == 51 and names["history"].confirmed
