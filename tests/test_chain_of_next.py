"""Following the `next:` lines leads to a table for the grinder: no command is repeated, no draft is ground, and a
required yield is kept.

Verbs that take minutes are replaced by functions that write the same files, from a table of possible results; one chain
runs the real verbs.
"""

import json
import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from camopt.cli import arguments, verbs
from camopt.cli import parser as cli
from camopt.optimizer import candidates
from camopt.optimizer.baselines import comparison
from camopt.scene import scene_text
from camopt.storage import write_json, write_text
from camopt.verifier import ACCURACY_NAMES
from tests.command_line import run
from tests.scene.test_load import EXAMPLE

CALM = EXAMPLE + '\n[[tolerance]]\nof = "spring.preload_N"\nrelative = 0.001\n'
MOST_STEPS = 10


@dataclass
class World:
    """The possible results of a scene: the verdict by accuracy, the yield of its largest cam, and the yields that a
    search reaches."""

    scatters: bool = True
    verdicts: tuple[str, str, str] = ("confirmed",) * 3
    share: float = 0.33
    reached: tuple[float, float, float] = (0.96, 0.96, 0.96)
    """By accuracy, the largest yield that a search reaches."""
    after_verify: int = 0
    commands: list[str] = field(default_factory=list)

    def optimize(self, args) -> int:
        folder, level = verbs.folder_of(args, "scene"), ACCURACY_NAMES.index(args.accuracy)
        folder.mkdir(parents=True)
        text = scene_text("motori-1")
        write_text(folder / "scene.toml", text if self.scatters else text[: text.index("[[tolerance]]")])
        settings = {"accuracy": args.accuracy, "speeds": args.speeds, "seed": 0}
        settings |= {"yield": args.wanted_yield} if args.wanted_yield else {}
        write_json(folder / "provenance.json", {"settings": settings})
        write_json(folder / "design.json", {"area_ratio": 0.5})
        content: dict = {"verdict": self.verdicts[level], "broken": []}
        confirmed = True
        if self.scatters:
            wanted = args.wanted_yield
            share = self.share if wanted is None else min(wanted + 0.005, self.reached[level])
            confirmed = None if wanted is None else share >= wanted
            trains = {"low": share - 0.02, "high": share + 0.02, "trains": 1000, "speeds_rpm": [5000, 7000]}
            content["yield"] = {"wanted": wanted, "confirmed": confirmed, "reasons": [], "share": share, **trains}
        write_json(folder / "verification.json", content)
        return 0 if content["verdict"] == "confirmed" and confirmed is not False else 3

    def yield_(self, args) -> int:
        folder = verbs.folder_of(args, "scene")
        folder.mkdir(parents=True, exist_ok=True)
        record = {"share": self.share, "low": self.share - 0.02, "high": self.share + 0.02, "trains": args.trains}
        write_json(folder / "yield.json", record)
        return 0

    def verify(self, args) -> int:
        return self.after_verify

    def nothing(self, args) -> int:
        if hasattr(args, "out"):
            verbs.folder_of(args, "scene").mkdir(parents=True)
        return 0

    def table(self, args) -> int:
        if args.csv:
            write_text(args.csv, "0,0\n")
        return 0


def follow(capsys, monkeypatch, tmp_path, world: World, *words: str) -> list[str]:
    """The commands from the first one until a table for the grinder is written."""
    monkeypatch.chdir(tmp_path)
    runs = iter(range(MOST_STEPS))
    monkeypatch.setattr(arguments, "default_run_folder", lambda name: Path("runs") / f"{name}-{next(runs)}")
    for verb in ("design", "modes", "bound", "gradient", "tradeoff", "extremes", "simulate", "scenes"):
        monkeypatch.setattr(verbs, verb, world.nothing)
    for verb, act in (("optimize", world.optimize), ("yield_", world.yield_), ("verify", world.verify)):
        monkeypatch.setattr(verbs, verb, act)
    monkeypatch.setattr(verbs, "cam", world.table)
    return chain(capsys, *words)


def chain(capsys, *words: str) -> list[str]:
    done: list[str] = []
    while len(done) < MOST_STEPS:
        command = shlex.join(words)
        assert command not in done, f"a loop: {done}"
        done.append(command)
        _, _, err = run(capsys, *words)
        if words[0] == "cam" and "--csv" in words:
            return done
        (line,) = (line for line in err.splitlines() if line.startswith("next: "))
        (following, *_) = re.findall("`(.*?)`", line)
        words = tuple(shlex.split(following.split(" > ")[0])[1:])
    raise AssertionError(f"no table for the grinder: {done}")


DRAFT = ("--accuracy", "draft")
HARD = World(reached=(0.9, 0.93, 0.94))
STARTS = {
    "default": (World(), ("optimize", "kodama"), 3),
    "draft": (World(), ("optimize", "kodama", *DRAFT), 3),
    "draft for a yield": (World(), ("optimize", "kodama", *DRAFT, "--yield", "0.95"), 3),
    "yield that is missed": (HARD, ("optimize", "kodama", "--yield", "0.95"), 4),
    "yield that a draft misses": (
        World(reached=(0.6, 0.96, 0.96)), ("optimize", "kodama", *DRAFT, "--yield", "0.9"), 3,
    ),
    "nothing scatters": (World(scatters=False), ("optimize", "plain.toml", *DRAFT), 3),
    "calm": (World(share=0.99), ("optimize", "kodama", *DRAFT), 3),
    "rejected at first": (World(verdicts=("rejected", "sensitive", "confirmed")), ("optimize", "kodama", *DRAFT), 5),
    "not converged at first": (
        World(verdicts=("not converged", "confirmed", "confirmed"), after_verify=3), ("optimize", "kodama", *DRAFT), 5,
    ),
    "modes": (World(), ("modes", "kodama"), 5),
    "rejected family": (World(after_verify=3), ("verify", "kodama", "--cam", "polydyne"), 4),
    "yield of a family": (World(), ("yield", "kodama", "--cam", "polydyne", "--trains", "50"), 4),
    "live": (World(), ("design", "kodama"), 4),
    "a motion": (World(), ("simulate", "kodama", "--cam", "polydyne", "--speed", "6000"), 4),
}  # fmt: skip


@pytest.mark.parametrize("name", STARTS)
def test_every_chain_ends_with_a_table_for_the_grinder(capsys, monkeypatch, tmp_path, name):
    world, words, most = STARTS[name]
    done = follow(capsys, monkeypatch, tmp_path, world, *words)
    assert len(done) <= most, done
    yields = [re.search(r"--yield ([\d.]+)", command) for command in done if command.startswith("optimize")]
    required = [verification is not None for verification in yields]
    assert required == sorted(required), f"a yield was asked for, and then none: {done}"
    folder = Path(shlex.split(done[-1])[3])
    if folder.is_dir():  # a family's cam has no run folder
        settings = json.loads((folder / "provenance.json").read_text())["settings"]
        assert settings["accuracy"] != "draft", done
        verification = json.loads((folder / "verification.json").read_text())
        assert verification["verdict"] == "confirmed"
        assert "yield" not in verification or verification["yield"]["confirmed"] or verification["yield"]["low"] >= 0.95


def test_a_yield_missed_at_the_finest_accuracy_is_lowered(capsys, monkeypatch, tmp_path):
    done = follow(capsys, monkeypatch, tmp_path, HARD, "optimize", "kodama", "--yield", "0.95")
    assert done[1:3] == ["optimize kodama --accuracy fine --yield 0.95", "optimize kodama --accuracy fine --yield 0.9"]


def test_the_steps_after_a_table_do_not_repeat(capsys, monkeypatch, tmp_path):
    """After the table its verdict and its yield follow; the yield is sufficient, and the last line ends the chain."""
    world = World(share=0.98)
    done = follow(capsys, monkeypatch, tmp_path, world, "optimize", "kodama")
    assert done[-1].startswith("cam")
    words, seen = tuple(shlex.split(done[-1])), []
    for _ in range(MOST_STEPS):
        _, _, err = run(capsys, *words)
        (line,) = (line for line in err.splitlines() if line.startswith("next: "))
        commands = re.findall("`(.*?)`", line)
        if not commands:
            assert "lift.csv can go to the grinder" in line
            break
        seen.append(commands[0])
        words = tuple(shlex.split(commands[0])[1:])
    assert [command.split()[1] for command in seen] == ["verify", "yield"]


def test_the_options_of_a_free_design_are_kept(capsys, monkeypatch, tmp_path):
    world = World()
    optimize = world.optimize

    def free(args) -> int:
        code = optimize(args)
        path = args.folder / "provenance.json"
        content = json.loads(path.read_text())
        content["settings"]["free"] = {"spring.preload_N": [200, 320]}
        write_json(path, content)
        return code

    monkeypatch.setattr(world, "optimize", free, raising=False)
    done = follow(capsys, monkeypatch, tmp_path, world, "optimize", "kodama", "--free", "spring.preload_N=200:320")
    assert done[1] == "optimize kodama --free spring.preload_N=200:320 --accuracy standard --yield 0.95"
    assert cli.parser().parse_args(shlex.split(done[1])).wanted_yield == 0.95


@pytest.mark.long
def test_a_chain_of_real_verbs(capsys, monkeypatch, tmp_path):
    """From the first draft for a user's scene with a small tolerance to the table."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(candidates, "FAMILIES", ("polydyne",))  # comparisons are tested elsewhere
    monkeypatch.setattr(comparison, "SECTIONED", ())
    write_text("calm.toml", CALM)
    done = chain(capsys, "optimize", "calm.toml", *DRAFT, "--speeds", "nominal", "--gradient", "none", "--no-compare")
    assert [command.split()[0] for command in done] == ["optimize", "optimize", "cam"]
    assert "--speeds nominal" in done[1]
    assert (tmp_path / "lift.csv").stat().st_size > 1000
