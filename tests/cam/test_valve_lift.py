"""The valve's lift for engine simulations: static and at a speed, and how a cam stands on the crank."""

import numpy as np
import pytest

from camopt.cam.card import CrankTiming
from camopt.cam.families.polydyne import polydyne
from camopt.cli import main
from camopt.scene import build_train, load_scene
from camopt.scene.units import DEG, MM
from camopt.study.simulate.motion import recorded

SCENE = load_scene("motori-1")
CAM = polydyne(SCENE)
LASH = build_train(SCENE).lash


def written(tmp_path, capsys, *options: str) -> tuple[np.ndarray, str]:
    file = tmp_path / "valve.dat"
    assert main(["cam", "motori-1", "--cam", "polydyne", options[0], str(file), *options[1:]]) == 0
    return np.loadtxt(file, delimiter="\t"), capsys.readouterr().out


def test_static_lift_is_the_cams_less_the_lash(tmp_path, capsys):
    rows, said = written(tmp_path, capsys, "--valve-lift", "--digits", "5")
    assert np.array_equal(rows[:, 0], np.arange(len(rows)))
    first = float(said.split("crank degrees ")[1].split(" to")[0])
    expected = np.maximum(CAM((rows[:, 0] + first) * SCENE.operation.cam_per_crank * DEG) - LASH, 0) / MM
    assert np.abs(rows[:, 1] - expected).max() <= 0.5e-5 + 1e-12
    assert rows[0, 1] == 0 < rows[1, 1] and rows[-1, 1] == 0 < rows[-2, 1]
    assert LASH > 0 and f"less the lash of {LASH / MM:g} mm" in said


def test_lift_at_a_speed_is_the_valves_own(tmp_path, capsys):
    speed = SCENE.operation.speeds_rpm[-1]
    rows, said = written(tmp_path, capsys, "--dynamic-lift", "--speed", f"{speed:g}")
    motion = recorded(SCENE, CAM, speed, "event", revolutions=6)
    first = float(said.split("crank degrees ")[1].split(" to")[0])
    angle = (motion.angle - motion.angle[-1]) / DEG + 180
    there = np.maximum(motion.seat_separation(), 0)[angle >= -180 - 1e-9]
    crank = (rows[:, 0] + first) * SCENE.operation.cam_per_crank
    expected = np.interp(crank, angle[angle >= -180 - 1e-9], there) / MM
    assert np.abs(rows[:, 1] - expected).max() <= 0.5e-6 + 1e-9
    static = np.maximum(CAM(crank * DEG) - LASH, 0) / MM
    assert np.abs(rows[:, 1] - static).max() > 0.01  # at its top speed the valve does not follow the cam
    assert f"at {speed:g} r/min" in said


def test_a_speed_is_asked_for(tmp_path, capsys):
    assert main(["cam", "motori-1", "--cam", "polydyne", "--dynamic-lift", str(tmp_path / "valve.dat")]) == 2
    assert "add --speed RPM" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("by", "value", "closing", "there"),
    [
        ("opening", -22.0, False, lambda timing, opens, closes: timing.crank_deg(opens) + 22.0),
        ("closing", 12.0, False, lambda timing, opens, closes: timing.crank_deg(closes) - 12.0),
        ("tdc-lift", 1.0, False, lambda timing, opens, closes: timing.crank_deg(opens)),
        ("tdc-lift", 1.0, True, lambda timing, opens, closes: timing.crank_deg(closes)),
        ("centre", 108.0, False, lambda timing, opens, closes: timing.crank_deg(0.0) - 108.0),
    ],
)
def test_a_cam_stands_on_the_crank_by_its_opening_its_centre_or_its_lift_at_the_top(by, value, closing, there):
    timing = CrankTiming.of(CAM, by, value, at_mm=1.0, closing=closing)
    opens, closes = CAM.roots(0, 1.0 * MM) / DEG
    assert there(timing, opens, closes) == pytest.approx(0.0, abs=1e-9)


def test_the_card_takes_an_opening(capsys):
    assert main(["cam", "kodama", "--cam", "polydyne", "--card", "--centre-deg", "opening=-22"]) == 0
    assert "opens 22.00 deg before TDC" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["cam", "kodama", "--cam", "polydyne", "--card", "--centre-deg", "top=3"])
    assert "'top=3': expected an angle, or opening=-22, closing=40 or tdc-lift=2.1" in capsys.readouterr().err
