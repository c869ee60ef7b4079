"""`camopt cam` with a follower: contact, contour, cam card and exchange files."""

import csv
import re

import numpy as np
import pytest

from camopt.cam.families.polydyne import polydyne
from camopt.cam.geometry import contact, crossing
from camopt.cam.read import read_cam
from camopt.scene import MotionRefused, load_scene, scene_text
from camopt.study.cam_sheet import dynamic_stress
from tests.command_line import run

GEOMETRY = """
[geometry]
follower = "roller"
base_radius_mm = 30
roller_radius_mm = 10
contact_width_mm = 12
rocker_ratio = 1.2
assumed = ["base_radius_mm"]
"""


class TestCamWithFollower:
    CAM = ("--cam", "polydyne")

    def scene(self, tmp_path, geometry: str, name: str = "kodama") -> str:
        """The built-in scene with its [geometry] replaced."""
        file = tmp_path / f"{name}.toml"
        file.write_text(re.sub(r"\[geometry\].*?(?=\n\[\[)", "", scene_text(name), flags=re.DOTALL) + geometry)
        return str(file)

    def test_contact_and_stress(self, capsys, tmp_path):
        """Printed values are those of the contact; the stress at standstill is calculated here by hand."""
        where = self.scene(tmp_path, GEOMETRY)
        code, out, _ = run(capsys, "cam", where, *self.CAM, "--speed", "4000")
        scene = load_scene(where)
        lift = polydyne(scene)
        geometry = contact(lift, scene.geometry)
        lines = [line.split() for line in out.splitlines()]
        shown = {" ".join(words[:-2]): float(words[-2]) for words in lines if words[-1] in ("mm", "deg")}
        assert code == 0
        assert shown["smallest convex radius"] == pytest.approx(geometry.smallest_convex * 1e3, abs=1e-4)
        assert shown["largest pressure angle"] == pytest.approx(np.degrees(geometry.pressure_angle.max()), abs=1e-4)
        assert "assumed: base_radius_mm" in out
        opening, _ = crossing(lift, 1e-3)
        assert f"{'open above 1 mm':<24} {np.degrees(opening):10.4f} to {-np.degrees(opening):.4f} deg" in out
        standing, moving, most = (line.split() for line in out.splitlines()[:-4:-1])
        force = 1.2 * (19.1 + 197.0 + 152000 / 6 * (9.4e-3 - 0.169e-3))
        radius = 1 / (1 / geometry.radius_of_curvature[np.argmin(np.abs(geometry.theta))] + 1 / 10e-3)
        by_hand = 0.418 * np.sqrt(force / 12e-3 * 210e9 / radius) / 1e6
        assert float(standing[2]) == pytest.approx(by_hand, rel=5e-3)
        assert float(moving[4]) > 1.02 * by_hand
        at_rpm = float(most[3])
        stress = dynamic_stress(scene, lift, at_rpm)[0].figures()["hertz_stress_MPa"]
        assert float(most[5]) == pytest.approx(stress, rel=2e-3) and stress > float(moving[4])
        assert scene.operation.band_rpm[0] <= at_rpm <= scene.operation.band_rpm[1]
        assert "(event-exact)" in out

    def test_surfaces_and_oil_film(self, capsys):
        code, out, _ = run(capsys, "cam", "kodama", *self.CAM, "--speed", "4000")
        assert code == 0
        assert "finger with a pad of radius 15 mm on a base circle of radius 18 mm" in out
        shown = {line[2:26].strip(): line.split() for line in out.splitlines() if line.startswith("  ")}
        geometry = contact(polydyne(KODAMA := load_scene("kodama")), KODAMA.geometry)
        assert float(shown["sliding velocity, most"][-2]) == pytest.approx(
            geometry.sliding.max() * KODAMA.cam_speed(4000), abs=2e-3
        )
        assert 0.1 < float(shown["film thickness ratio"][-4]) < 5

    def test_laws_that_event_exact_does_not_support(self, capsys, tmp_path):
        where = self.scene(tmp_path, GEOMETRY, "kodama-hertz")
        code, out, _ = run(capsys, "cam", where, *self.CAM, "--speed", "6000")
        assert (code, "6000 r/min (rkg)" in out) == (0, True)

    def test_a_refused_motion_is_not_tried_again_with_the_same_method(self, capsys, tmp_path, monkeypatch):
        tried = []

        def refuses(scene, cam, speed_rpm, method, revolutions):
            tried.append(method)
            raise MotionRefused(f"{method} refuses")

        monkeypatch.setattr("camopt.study.simulate.motion.recorded", refuses)
        for name, methods in (("kodama", ["event", "rkg"]), ("kodama-hertz", ["rkg"])):
            tried.clear()
            where = self.scene(tmp_path, GEOMETRY, name)
            run(capsys, "cam", where, *self.CAM, "--speed", "6000")
            assert tried == methods

    def test_faults_are_reported_as_sentences(self, capsys, tmp_path):
        where = self.scene(tmp_path, '[geometry]\nfollower = "flat"\nbase_radius_mm = 5\nface_width_mm = 12\n')
        code, out, _ = run(capsys, "cam", where, "--cam", "exponent", "--speed", "6000")
        assert code == 0
        assert "fault: a flat follower needs a contour without cusp" in out
        assert "fault: the contact needs a face" in out
        assert any(line.startswith("Hertz stress: none without a contour") for line in out.splitlines())

    def test_exports(self, capsys, tmp_path):
        table, contour = tmp_path / "lift.csv", tmp_path / "contour.csv"
        words = ("--csv", str(table), "--contour", str(contour), "--step-deg", "0.5", "--digits", "4")
        code, out, _ = run(capsys, "cam", self.scene(tmp_path, GEOMETRY), *self.CAM, *words)
        assert code == 0
        assert "contour: for a roller follower on a base circle of radius 30 mm; " in out
        assert "the cam turns clockwise, its opening flank below: for the other sense of rotation change" in out
        assert "note: the outline depends on assumed numbers: measure base_radius_mm before it is ground" in out
        table_only = run(capsys, "cam", self.scene(tmp_path, GEOMETRY), *self.CAM, *words[:2])[1]
        measured = self.scene(tmp_path, GEOMETRY.replace('assumed = ["base_radius_mm"]', ""))
        assert "measure" not in table_only + run(capsys, "cam", measured, *self.CAM, *words)[1]
        assert table.read_text().splitlines()[:2] == ["cam_angle_deg,lift_mm,tappet_lift_mm", "-180,0.0000,0.0000"]
        first, row = contour.read_text().splitlines()[:2]
        assert first == "cam_angle_deg,x_mm,y_mm,polar_angle_deg,radius_mm"
        assert row == "-180,-30.00000,0.00000,-180.0000000,30.00000"
        opening = next(row for row in contour.read_text().splitlines() if row.startswith("-60,"))
        assert float(opening.split(",")[2]) < -1.0  # below, as stated by the sentence on the sense of rotation
        assert table.read_text().splitlines()[361] == "0,9.4000,7.8333"

    def test_the_error_of_a_written_table_is_reported(self, capsys, tmp_path):
        files = ("--csv", str(tmp_path / "lift.csv"), "--step-crank-deg", "1", "--digits", "4")
        code, out, _ = run(capsys, "cam", self.scene(tmp_path, GEOMETRY), *self.CAM, *files)
        assert code == 0
        assert "lift table: a row every 1 crank deg, 4 decimals: off by at most 4.9e-05 mm at its rows" in out
        assert len((tmp_path / "lift.csv").read_text().splitlines()) == 721 + 3

    def test_card(self, capsys, tmp_path):
        """The card in crank degrees with an overlap, as text and as a table."""
        file = tmp_path / "card.csv"
        words = ("--centre-deg", "108", "--exhaust", "exponent", "--exhaust-centre-deg", "-112", "--lifts-mm", "1,1.27")
        code, out, _ = run(capsys, "cam", "kodama", *self.CAM, *words, "--card-csv", str(file), "--lobes-deg", "0,90")
        with open(file, newline="") as text:
            rows = list(csv.DictReader(text))
        cams = [polydyne(load_scene("kodama")), read_cam("exponent", load_scene("kodama"))]
        assert code == 0
        assert [row["cam"] for row in rows] == ["intake, polydyne"] * 2 + ["exhaust, exponent"] * 2
        (_, closing), (opening, _) = (np.degrees(crossing(cam, 1e-3)) for cam in cams[::-1])
        expected = (2 * closing - 112) - (2 * opening + 108)
        assert float(rows[0]["overlap_crank_deg"]) == pytest.approx(expected, abs=5.1e-5)  # the file has four decimals
        assert f"overlap {expected:.2f} deg" in out
        assert "torque of 2 lobes standing still" in out

    @pytest.mark.parametrize(
        ("words", "says"),
        [
            (("--contour", "c.csv"), "--contour needs [geometry]"),
            (("--speed", "6000"), "--speed needs [geometry]"),
            (("--dxf", "c.dxf"), "--dxf needs [geometry]"),
            (("--digits", "13"), "an integer from 0 to 12"),
            (("--step-crank-deg", "1"), "add --csv FILE"),
            (("--step-deg", "0.7", "--csv", "t.csv"), "a step that divides 360 deg"),
            (("--step-crank-deg", "0.7", "--csv", "t.csv"), "a step that divides 360 deg"),
            (("--exhaust", "polydyne", "--centre-deg", "108"), "add --centre-deg and --exhaust-centre-deg"),
            (("--exhaust-centre-deg", "-110"), "belongs to --exhaust"),
            (("--centre-deg", "1e9"), "expected an angle from -720 to 720"),
            (("--lifts-mm", "1,x"), "'x': expected a number above 0"),
            (("--lifts-mm", "12"), "12 mm is not below the maximum lift"),
        ],
    )
    def test_wrong_use(self, capsys, words, says):
        code, _, err = run(capsys, "cam", "motori-1", *self.CAM, *words)
        assert (code, says in err) == (2, True)
