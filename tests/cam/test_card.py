"""The cam card against the roots of the pieces, found here one by one, above all on asymmetric cams."""

import numpy as np
import pytest

from camopt.cam.card import COLUMNS, CrankTiming, cam_card, dead_centre_words
from camopt.cam.lift import Lift
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
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
