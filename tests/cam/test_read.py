"""CAM as the user names one: families with parameters, run folders and design.json."""

import json
from pathlib import Path

import numpy as np
import pytest

from camopt.cam.design_file import as_written, design_record, read_design, write_design
from camopt.cam.families.polydyne import polydyne
from camopt.cam.families.registry import FAMILIES
from camopt.cam.read import read_cam
from camopt.scene import InputError
from camopt.scene.units import DEG, MM
from tests.cam.cams import KODAMA, POLYDYNE, difference


class TestFamilies:
    def test_plain_name_is_the_default_member(self):
        assert difference(read_cam("polydyne", KODAMA), POLYDYNE) == 0

    def test_parameters_reach_the_family(self):
        spec = "polydyne:exponents=2/12/20/32/34,speed_rpm=6000,ramp_height_mm=0.25"
        expected = polydyne(KODAMA, (2, 12, 20, 32, 34), design_speed_rpm=6000, ramp_height_mm=0.25)
        assert difference(read_cam(spec, KODAMA), expected) == 0
        assert difference(read_cam("polydyne:speed_rpm=6000", KODAMA), POLYDYNE) > 1e-3 * MM

    @pytest.mark.parametrize("name", FAMILIES)
    def test_every_family_designs_a_cam_for_kodama(self, name):
        assert 0.5 < read_cam(name, KODAMA).area_ratio(9.4 * MM) < 0.7

    @pytest.mark.parametrize(
        ("spec", "says"),
        [
            ("polydine", "neither a family .*polydyne"),
            ("", "neither a family"),
            (Path("polydyne"), "a family; expected a run folder"),  # of `compare --design`
            ("old/first", "there is no such file or folder"),
            ("intake.svl", "there is no such file or folder"),
            ("polydyne:speed=6000", "'speed=6000'.*speed_rpm="),
            ("polydyne:speed_rpm", "'speed_rpm'.*exponents="),
            ("polydyne:speed_rpm=fast", "expected a number"),
            ("polydyne:speed_rpm=nan", "expected a number"),
            ("polydyne:exponents=2/x/3", "numbers like 2/10/18"),
            ("polydyne:exponents=2/10", "five distinct"),
            ("polydyne:speed_rpm=6000,speed_rpm=5000", "more than once"),
        ],
    )
    def test_faults(self, spec, says):
        with pytest.raises(InputError, match=says) as error:
            read_cam(spec, KODAMA)
        assert "\n" not in str(error.value)


# a parameter at each end, and the word of the sentence that refuses it
ENDS = [
    *((f"polydyne:speed_rpm={v}", "speed_rpm|design speed|its lift would go") for v in ("5e-324", "1e308", "-1", "0")),
    *(
        (f"polydyne:speed_rpm={v}", "design speed|correction gives no valid cam")
        for v in ("0.003", "1e-6", "10", "100")
    ),
    *(
        (f"polydyne:ramp_height_mm={v}", "ramp_height_mm|ramp's height|duration and ramps together")
        for v in ("10", "0.003", "0", "-1", "1e-300")
    ),
    ("multi-pol:a12_mm_per_deg2=1e308,sections_deg=7.5/11.5/7.5/22.7/22.8", "a12_mm_per_deg2"),
    ("multi-pol:sections_deg=1e308/1/1/1/1", "sections_deg"),
    ("new-design:sections_deg=1e-300/24/24/24", "sections_deg"),
    ("kurz:sections_deg=24/25/23,a23_mm_per_deg2=100", "its lift would go"),
    ("kurz:sections_deg=24/25/23,a23_mm_per_deg2=-1", "its lift would go from .* to 205"),
    ("trapezoid:sections_deg=1e-300/24/24/24", "sections_deg"),
    ("polydyne:" + "x" * 9000, "parameter 'xx"),
]


@pytest.mark.parametrize(("spec", "says"), ENDS, ids=[spec[:40] for spec, _ in ENDS])
def test_parameters_at_their_ends_are_sentences(spec, says):
    with pytest.raises(InputError, match=says) as error:
        read_cam(spec, KODAMA)
    assert "\n" not in str(error.value) and len(str(error.value)) < 400


@pytest.mark.parametrize("height", [0.0551, 0.25, 0.9])
def test_ramp_heights_within_the_ends(height):
    lift = read_cam(f"polydyne:ramp_height_mm={height}", KODAMA)
    assert lift(-lift.half_duration) == pytest.approx(height * MM, rel=1e-9)
    assert lift.max_lift == pytest.approx(9.4 * MM, rel=1e-6)


class TestDesignFile:
    def test_round_trip_is_exact(self, tmp_path):
        file = tmp_path / "design.json"
        write_design(file, POLYDYNE, 9.4 * MM, area_gap_percent=1.5, gradient_gain=float("nan"))
        back = read_cam(tmp_path, KODAMA)
        assert difference(back, POLYDYNE) < 1e-12 * MM
        for order in (1, 2, 3):
            assert difference(back, POLYDYNE, order) < 1e-11 * np.abs(POLYDYNE.extremes(order)).max()
        assert back.half_duration == pytest.approx(POLYDYNE.half_duration, rel=1e-15)
        assert (back.family, back.parameters) == ("polydyne", POLYDYNE.parameters)
        assert difference(read_cam(str(file), KODAMA), back) == 0

    def test_content_is_the_contracts(self, tmp_path):
        write_design(tmp_path / "d.json", POLYDYNE, 9.4 * MM, area_gap_percent=1.5, gradient_gain=float("nan"))
        data = json.loads((tmp_path / "d.json").read_text())
        assert (data["area_gap_percent"], data["gradient_gain"]) == (1.5, None)
        assert data["area_mm_deg"] == pytest.approx(POLYDYNE.area / MM / DEG)
        assert data["area_ratio"] == pytest.approx(data["area_mm_deg"] / (9.4 * 144))
        pieces = data["pieces"]
        assert (pieces["start_deg"][0], pieces["end_deg"][-1]) == (-180, 180)
        nose = pieces["start_deg"].index(0.0) - 1
        u = pieces["end_deg"][nose] - pieces["start_deg"][nose]
        assert sum(c * u**k for k, c in enumerate(pieces["coefficients_mm"][nose])) == pytest.approx(9.4, abs=1e-9)

    def test_duration_falls_back_to_the_scene(self, tmp_path):
        record = plain_record()
        del record["duration_deg"]
        assert read_design(written(tmp_path, record), KODAMA).half_duration == pytest.approx(72 * DEG)

    def test_the_cam_as_written_is_the_cam_that_is_read(self, tmp_path):
        write_design(tmp_path / "design.json", POLYDYNE, 9.4 * MM)
        read, known = read_design(tmp_path / "design.json", KODAMA), as_written(POLYDYNE)
        assert read.borders.tobytes() == known.borders.tobytes() != POLYDYNE.borders.tobytes()
        assert read.coefficients.tobytes() == known.coefficients.tobytes() != POLYDYNE.coefficients.tobytes()
        assert read.half_duration == known.half_duration

    def test_pieces_of_different_degree(self, tmp_path):
        record = plain_record()
        record["pieces"]["coefficients_mm"] = [trimmed(row) for row in record["pieces"]["coefficients_mm"]]
        assert difference(read_design(written(tmp_path, record), KODAMA), POLYDYNE) < 1e-12 * MM

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            (lambda r: r.pop("pieces"), "'pieces' is missing"),
            (lambda r: r["pieces"].pop("end_deg"), "'end_deg' is missing"),
            (lambda r: r["pieces"]["start_deg"].pop(), "equal length"),
            (lambda r: r["pieces"].update(start_deg=[], end_deg=[], coefficients_mm=[]), "equal length"),
            (lambda r: r["pieces"]["start_deg"].__setitem__(0, -179.0), "cover -180 to 180"),
            (lambda r: r["pieces"]["end_deg"].__setitem__(3, 0.0), "cover -180 to 180"),
            (lambda r: r["pieces"]["coefficients_mm"][5].__setitem__(0, float("nan")), "finite"),
            (lambda r: r["pieces"]["coefficients_mm"][5].__setitem__(0, "x"), "not a design.json"),
            (lambda r: r["pieces"]["start_deg"].__setitem__(0, "a" * 20_000), "not a design.json"),
            (lambda r: r["pieces"]["coefficients_mm"].__setitem__(5, []), "1 to 64 numbers"),
            (lambda r: r["pieces"]["coefficients_mm"][5].__setitem__(0, 7.0), "steps by"),
            (lambda r: r.update(duration_deg=400), "between 0 and 360"),
        ],
    )
    def test_faults(self, tmp_path, change, says):
        record = plain_record()
        change(record)
        with pytest.raises(InputError, match=says) as error:
            read_design(written(tmp_path, record), KODAMA)
        assert "design.json" in str(error.value)
        assert "\n" not in str(error.value)
        assert len(str(error.value)) < 1500

    @pytest.mark.parametrize(("text", "says"), [("{", "not valid JSON"), ("[1]", "an object"), ("\xff", "UTF-8")])
    def test_files_that_are_no_designs(self, tmp_path, text, says):
        file = tmp_path / "design.json"
        file.write_bytes(text.encode("latin-1"))
        with pytest.raises(InputError, match=says):
            read_cam(str(file), KODAMA)

    def test_folder_without_design(self, tmp_path):
        with pytest.raises(InputError, match=r"holds no design\.json"):
            read_cam(tmp_path, KODAMA)


def plain_record() -> dict:
    from camopt.storage import plain

    return plain(design_record(POLYDYNE, 9.4 * MM))


def written(folder, record: dict):
    file = folder / "design.json"
    file.write_text(json.dumps(record))
    return file


def trimmed(row: list[float]) -> list[float]:
    while len(row) > 1 and row[-1] == 0:
        row = row[:-1]
    return row
