"""The worked examples of the pages on extending camopt run when written to a file and registered by their line."""

import importlib.util
import re
import sys
import types
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

import camopt
from camopt.cam.families.record import Family
from camopt.cam.families.registry import FAMILIES
from camopt.cli import parser as cli
from camopt.exact import prepare
from camopt.optimizer.baselines.largest_member import family_space
from camopt.plots.style import OTHERS, cam_line
from camopt.scene import InputError, build_train, load_scene, rest_position
from camopt.scene.units import DEG, MM, MM_PER_DEG
from camopt.smooth.families import differentiable
from camopt.verifier.methods import INDEPENDENT
from camopt.verifier.verdict import verdict_on

SCENE = load_scene("motori-1")
HOW_TO = Path(__file__).parents[1] / "docs" / "how-to"


def blocks(page: str) -> list[str]:
    """The code of the file and the registry line of a page's example."""
    return re.findall(r"```py\n(.*?)```", (HOW_TO / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes an example to a file and imports it as the module that its registry line names."""

    def write(code: str, module: str):
        file = tmp_path / (module.rpartition(".")[2] + ".py")
        file.write_text(code, encoding="utf-8")
        spec = importlib.util.spec_from_file_location(module, file)
        assert spec is not None and spec.loader is not None
        made = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, module, made)
        spec.loader.exec_module(made)
        return made

    return write


class TestAddingAFamily:
    @pytest.fixture
    def family(self, written, monkeypatch):
        code, line = blocks("add-a-family.md")
        made = written(code, "camopt.cam.families.two_parabolas")
        monkeypatch.setitem(FAMILIES, *next(iter(eval(f"{{{line}}}").items())))
        return made

    def test_it_is_a_cam_of_the_scene(self, family):
        lift = camopt.read_cam("two-parabolas:sections_deg=22/50", SCENE)
        assert SCENE.design is not None and SCENE.design.duration_deg == 144
        assert lift.max_lift == pytest.approx(SCENE.design.max_lift_mm * MM, rel=1e-9)
        top = -lift.half_duration * (1 - 1e-12)
        height, velocity, _ = SCENE.design.ramps()[0]
        assert lift(top) == pytest.approx(height * MM, rel=1e-9)
        assert lift(top, 1) == pytest.approx(velocity * MM_PER_DEG, rel=1e-6)
        # each acceleration is the parabola of the page: its middle value is 3/2 of its mean, which follows from v12
        rise = lift((-72 + 22) * DEG, 1) - velocity * MM_PER_DEG
        assert lift((-72 + 11) * DEG, 2) == pytest.approx(1.5 * rise / (22 * DEG), rel=1e-9)
        assert lift(0.0, 1) == pytest.approx(0.0, abs=1e-9)

    def test_commands_accept_it(self, family, capsys, tmp_path):
        table = tmp_path / "lift.csv"
        code = cli.main(["cam", "motori-1", "--cam", "two-parabolas:sections_deg=22/50", "--csv", str(table)])
        assert code == 0 and "two-parabolas" in capsys.readouterr().out
        assert table.read_text().startswith("cam_angle_deg,lift_mm")
        assert cli.main(["cam", "motori-1", "--cam", "two-parabolas:sections_deg=22"]) == 2
        assert "2 positive angles" in capsys.readouterr().err

    def test_it_is_verified_differentiable_and_searched(self, family):
        lift = camopt.read_cam("two-parabolas:sections_deg=22/50", SCENE)
        verdict = verdict_on(SCENE, lift, (4000.0,), ("event", "rkg"), band_step_rpm=None)
        assert verdict.speeds[0].methods["rkg"].converged
        cam = differentiable(SCENE, lift)
        quick = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}
        slope = np.asarray(jax.jit(jax.grad(cam.area), compiler_options=quick)(cam.parameters)["sections_deg"])
        step = 1e-3
        areas = [family.two_parabolas(SCENE, (22 + s, 50 - s)).area for s in (-step, step)]
        assert slope == pytest.approx((areas[1] - areas[0]) / (2 * step), rel=1e-6)
        space = family_space(SCENE, "two-parabolas", jerk=True)
        assert len(space.known) == 1 and space.largest is not None
        assert cam_line("two-parabolas:sections_deg=22/50")["color"] == "#2F4B7C"

    def test_a_record_with_only_a_name_and_a_function_is_a_family(self, monkeypatch, capsys):
        """Such a family can be used in every command, is represented by its default member, and has no gradient."""
        toy = types.ModuleType("camopt.cam.families.toy")
        toy.FAMILY = Family("toy", lambda scene: replace(camopt.cycloidal(scene), family="toy"))
        monkeypatch.setitem(sys.modules, "camopt.cam.families.toy", toy)
        monkeypatch.setitem(FAMILIES, "toy", "camopt.cam.families.toy:FAMILY")
        assert cli.main(["cam", "motori-1", "--cam", "toy"]) == 0 and "toy" in capsys.readouterr().out
        with pytest.raises(InputError, match="cam toy: parameter 'a=1': this family has none"):
            camopt.read_cam("toy:a=1", SCENE)
        space = family_space(SCENE, "toy", jerk=True)
        assert space.bounds == [] and space.member(np.zeros(0)).family == "toy"
        with pytest.raises(InputError, match="cam 'toy': its family has no"):
            differentiable(SCENE, camopt.read_cam("toy", SCENE))
        assert cam_line("toy")["color"] in OTHERS


class TestAddingAMethod:
    NAME = "semi-implicit-euler"

    @pytest.fixture
    def method(self, written, monkeypatch):
        code, line = blocks("add-a-method.md")
        made = written(code, "camopt.verifier.methods.semi_implicit_euler")
        monkeypatch.setitem(INDEPENDENT, *next(iter(eval(f"{{{line}}}").items())))
        return made

    def test_it_is_of_first_order(self, method):
        """Compared with event-exact before the seat first closes, where the motion is smooth except at one contact."""
        train, lift, speed = build_train(SCENE), camopt.polydyne(SCENE), SCENE.cam_speed(4000)
        rest = rest_position(train)
        state = np.concatenate([rest, np.zeros_like(rest)])
        truth = prepare(train, lift, speed, 1440)(state)
        errors = []
        for steps in (14_400, 28_800):
            response = method.prepare(train, lift, speed, steps)(state)
            at = np.searchsorted(truth.angle, 0.0)  # the nose
            errors.append(abs(np.interp(truth.angle[at], response.angle, response.x[:, 0]) - truth.x[at, 0]))
        assert 1e-9 < errors[1] < 1e-6
        assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.3)

    def test_commands_accept_it_and_a_verdict_includes_it(self, method, capsys):
        words = ["motori-1", "--cam", "polydyne"]
        assert cli.main(["simulate", *words, "--speed", "4000", "--method", self.NAME, "--step-deg", "1"]) == 0
        assert "revolution 2" in capsys.readouterr().out
        verdict = verdict_on(SCENE, camopt.polydyne(SCENE), (4000.0,), ("event", self.NAME), band_step_rpm=None)
        answers = verdict.speeds[0].methods
        error = answers[self.NAME].error["bounce_mm"] + 2e-3
        assert abs(answers[self.NAME].worst["bounce_mm"] - answers["event"].worst["bounce_mm"]) <= error
