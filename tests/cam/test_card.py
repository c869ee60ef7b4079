"""The cam card against the roots of the pieces, found here one by one, above all on asymmetric cams; the valve's lift
for engine simulations; and how a cam stands on the crank."""

import numpy as np
import pytest

from camopt.cam.card import COLUMNS, CrankTiming, cam_card, dead_centre_words
from camopt.cam.families.polydyne import polydyne
from camopt.cam.lift import Lift
from camopt.cli import main
from camopt.scene import InputError, build_train, load_scene
from camopt.scene.units import DEG, MM
from camopt.study.simulate.motion import recorded
from tests.cam.cams import POLYDYNE, cam_of


def skewed(theta):
    """A lobe with its top at 20 deg, 95 deg of opening and 75 deg of closing flank, and base circle around."""
    opening, closing = 95 * DEG, 75 * DEG
    x = np.where(theta < 20 * DEG, (theta - 20 * DEG) / opening, (theta - 20 * DEG) / closing)
    return 9 * MM * np.where(np.abs(x) < 1, np.cos(np.pi * np.clip(x, -1, 1) / 2) ** 4, 0.0)


ASYMMETRIC = cam_of(skewed)
LIFTS = (0.1, 1.0, 1.27, 5.0, 8.9)


def crossings(cam: Lift, height: float) -> np.ndarray:
    """Angles [deg] at which a piece has this lift [m], by NumPy's roots of each piece on its own."""
    found = []
    for c, start, end in zip(cam.coefficients, cam.borders[:-1], cam.borders[1:], strict=True):
        roots = np.roots(np.trim_zeros((c - height * (np.arange(len(c)) == 0))[::-1], "f"))
        real = roots[np.abs(roots.imag) < 1e-9].real
        found += [*(start + real[(real >= -1e-12) & (real <= end - start + 1e-12)])]
    return np.sort(np.array(found)) / DEG


@pytest.mark.parametrize("cam", [ASYMMETRIC, POLYDYNE], ids=["asymmetric", "polydyne"])
def test_events_are_the_roots_of_the_pieces(cam):
    card = cam_card(cam, LIFTS)
    assert [e.lift_mm for e in card.events] == [*LIFTS]
    for event in card.events:
        roots = crossings(cam, event.lift_mm * MM)
        assert (event.opening_deg, event.closing_deg) == pytest.approx((roots[0], roots[-1]), abs=1e-7)
        assert event.duration_deg == pytest.approx(roots[-1] - roots[0], abs=1e-7)
        assert event.centre_deg == pytest.approx((roots[0] + roots[-1]) / 2, abs=1e-7)


def test_an_asymmetric_cam_is_not_half_a_duration_about_its_top():
    """The opening differs by degrees from the top less half the duration: the shortcut of other tools."""
    card = cam_card(ASYMMETRIC)
    assert card.max_lift_deg == pytest.approx(20.0, abs=1e-3)
    assert card.max_lift_mm == pytest.approx(9.0, rel=1e-9)
    (event, _) = card.events
    assert abs(event.opening_deg - (card.max_lift_deg - event.duration_deg / 2)) > 5


def test_the_middle_of_a_dwell_is_its_top():
    flat = Lift(
        np.array([-np.pi, -1.0, 0.0, 1.0, 2.0, np.pi]),
        np.array([[0, 0, 0, 0.0], [0, 0, 3, -2], [1, 0, 0, 0], [1, 0, -3, 2], [0, 0, 0, 0]]) * 8 * MM,
        1.5,
    )
    assert cam_card(flat).max_lift_deg == pytest.approx(0.5 / DEG)


class TestOnTheCrank:
    INTAKE, EXHAUST = CrankTiming(108.0), CrankTiming(-112.0)

    def test_crank_angles_are_twice_the_cam_s(self):
        card = cam_card(ASYMMETRIC, LIFTS, name="intake", timing=self.INTAKE)
        for row, event in zip(card.rows(), card.events, strict=True):
            named = dict(zip(COLUMNS, row, strict=True))
            assert named["opening_crank_deg"] == pytest.approx(108 + 2 * event.opening_deg)
            assert named["closing_crank_deg"] == pytest.approx(108 + 2 * event.closing_deg)
            assert named["duration_crank_deg"] == pytest.approx(2 * event.duration_deg)
        assert card.tdc_lift_mm == pytest.approx(skewed(-54 * DEG) / MM, rel=1e-6)

    def test_overlap_is_what_a_fine_grid_of_both_lifts_shows(self):
        exhaust = cam_card(ASYMMETRIC, LIFTS, name="exhaust", timing=self.EXHAUST)
        card = cam_card(POLYDYNE, LIFTS, timing=self.INTAKE, other=exhaust)
        crank = np.linspace(-180, 180, 360_001)
        intake, other = POLYDYNE((crank - 108) / 2 * DEG), ASYMMETRIC((crank + 112) / 2 * DEG)
        for event, overlap in zip(card.events, card.overlaps, strict=True):
            both = np.minimum(intake, other) > event.lift_mm * MM
            assert max(overlap, 0.0) == pytest.approx(np.count_nonzero(both) * 1e-3, abs=2e-3)
        assert card.overlaps[0] > 50 and card.overlaps[-1] < 0

    def test_turns_of_the_camshaft_do_not_matter(self):
        later = cam_card(ASYMMETRIC, LIFTS, timing=CrankTiming(-112.0 + 720))
        earlier = cam_card(ASYMMETRIC, LIFTS, timing=self.EXHAUST)
        found = [cam_card(POLYDYNE, LIFTS, timing=self.INTAKE, other=one).overlaps for one in (later, earlier)]
        assert found[0] == pytest.approx(found[1])

    def test_text(self):
        exhaust = cam_card(ASYMMETRIC, timing=self.EXHAUST)
        text = str(cam_card(POLYDYNE, timing=self.INTAKE, other=exhaust))
        assert "on the crank, the middle 108 deg after TDC" in text
        assert "overlap" in text and "overlap" not in str(exhaust)

    @pytest.mark.parametrize(
        ("angle", "words"),
        [(-12, "12.00 deg before TDC"), (232.5, "52.50 deg after BDC"), (-230, "50.00 deg before BDC"),
         (0, "0.00 deg after TDC"), (100, "80.00 deg before BDC"), (370, "10.00 deg after TDC")],
    )  # fmt: skip
    def test_dead_centres(self, angle, words):
        assert words in dead_centre_words(angle)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"lifts_mm": (12.0,)}, "12 mm is not below the maximum lift"),
        ({"lifts_mm": ()}, "0 lifts: from 1 to 1000"),
        ({"other": cam_card(POLYDYNE)}, "needs the crank angle of both"),
        (
            {"other": cam_card(POLYDYNE, (2.0,), timing=CrankTiming(0.0)), "timing": CrankTiming(0.0)},
            "at the same lifts",
        ),
    ],
)
def test_bad_cards(arguments, says):
    with pytest.raises(InputError, match=says):
        cam_card(POLYDYNE, **arguments)


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
