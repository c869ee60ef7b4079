"""The main job: bound, search, verdict by independent methods, comparison, run folder."""

import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits

from camopt.cam.design_file import as_written, design_record
from camopt.cam.lift import Lift
from camopt.cam.tables.lift_table import write_lift_table
from camopt.optimizer.accuracy import Accuracy, accuracy_named, drawn_speeds
from camopt.optimizer.as_built.checks import check_wanted
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.candidates import CandidateCam, family_cams, largest_confirmed
from camopt.optimizer.first_run import SAYING, compile_programs, programs_missing
from camopt.optimizer.free_numbers import free_numbers, with_best_values
from camopt.optimizer.program.kinematic import KinematicOptimum, kinematic_optimum
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search import cams
from camopt.optimizer.search.search import find_cam
from camopt.optimizer.stage_clock import Progress, StageClock
from camopt.scene.errors import InputError, NoCamFound
from camopt.scene.schema import Scene
from camopt.scene.smoothing import smoothing, smoothing_in
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM
from camopt.storage import check_run_folder, default_run_folder, run_folder, run_identity, write_json, write_text
from camopt.storage.journal import StepFiles
from camopt.verifier.verdict import Verdict

if TYPE_CHECKING:
    from camopt.optimizer.as_built.statement import YieldStatement

PACKAGES = ("camopt", "jax", "diffrax", "optax", "numpy", "scipy", "highspy", "numba", "matplotlib")
SPEEDS = ("band", "nominal")
GRADIENTS = ("auto", "smooth", "exact", "none")
SHOWN = ("area_ratio", "area_ratio_bound", "area_gap_percent", "area_ratio_no_jump", "gradient_gain")
"""Numbers of the record that a notebook shows above the verdict."""


@dataclass(frozen=True, repr=False)
class Run:
    """The outcome of an optimisation: its folder, the cam, its verdict, and the numbers of `design.json`."""

    folder: Path
    lift: Lift
    verdict: Verdict
    record: dict
    exit_code: int  # 0 confirmed, 3 not
    as_built: "YieldStatement | None" = None  # of drawn trains; None if nothing scatters

    def __repr__(self) -> str:
        built = "" if self.as_built is None else f", {self.as_built.share} of trains as built"
        return f"Run({self.verdict.verdict}, area ratio {self.record['area_ratio']:.5f}{built}, {self.folder})"

    def plot(self):
        """Bounce and jump against speed as a matplotlib Figure."""
        return self.verdict.plot()

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        rows = {name.replace("_", " "): self.record[name] for name in SHOWN} | {"run folder": str(self.folder)}
        table = DataFrame([rows.keys(), rows.values()]).T
        shown = table.to_html(index=False, header=False, float_format="{:.5f}".format)
        built = "" if self.as_built is None else f"<p>{self.as_built._repr_html_()}</p>"
        return shown + built + self.verdict._repr_html_()


@threadpool_limits.wrap(limits=1, user_api="blas")  # the matrices are small, and the judge has threads of its own
def optimize(
    scene: Scene,
    speeds: str = "band",
    accuracy: str = "standard",
    gradient: str = "auto",
    out: Path | str | None = None,
    seed: int = 0,
    resume: bool = False,
    progress: bool = False,
    designed: Callable[[Path], object] = lambda folder: None,
    *,
    compare: bool = True,
    wanted_yield: float | None = None,
    free: Mapping[str, Sequence[float]] | None = None,
    start: Lift | None = None,
    source: str | None = None,
    width_um: float = 1.0,
    tie: float = 1.0,
    steps_per_revolution: int = 1440,
) -> Run:
    """Design the cam of largest area that a scene's limits allow, verify it and compare it.

    `speeds` is "band" (every speed of the scene's band) or "nominal" (its listed speeds (k) [r/min]), `accuracy` a name
    of `camopt.optimizer.accuracy`. `gradient` selects the search (`camopt.optimizer.search.search`): "auto" and
    "smooth" use the slopes of the smoothed motion by JAX, "exact" those of the closed periodic response, and "none"
    runs the first stage alone. The search begins from the cam `start`, by default from the calmest one. The run folder
    (docs/run-folder.md) is `out` (default runs/<scene>-<UTC time>), without report.html, which `camopt.report` makes
    from it. With `resume` an interrupted run in `out` is continued and ends in the same design. A `seed` other than
    zero draws the knots. If the scene has tolerances, `as_built` of the result has the share of fresh trains in which
    the cam holds; with `wanted_yield`, such as 0.99, the run is confirmed only if at least that share of them holds
    over the band. `designed` is called with the folder once the design, its verdict, that share and the provenance are
    written, before the comparison, whose failure cannot lose them; without `compare` there is none. `free` names
    numbers of the scene that the design may choose, with their ranges (low, high) in the key's unit, as
    {"spring.preload_N": (200, 320)} (`camopt.optimizer.free_numbers`); the folder's scene.toml has the chosen values.
    `source` is another name of `gradient`; `width_um`, `tie` and `steps_per_revolution` are as in `linearised`. If a
    family's largest member is confirmed and larger than the search's cam, it is the design.

    Raises InputError for unknown words, contradictory limits, an unusable folder or one of another run, and its
    subclass NoCamFound if the search finds no cam and no family's largest member is confirmed.
    """
    settings = {"speeds": speeds, "accuracy": accuracy, "gradient": source or gradient, "seed": seed}
    settings |= smoothing("optimize", width_um, tie, steps_per_revolution).as_asked
    settings |= {} if wanted_yield is None else {"yield": wanted_yield}
    settings |= {} if start is None else {"start": {"family": start.family, "area_m_rad": float(start.area)}}
    settings |= {} if not free else {"free": {name: list(map(float, ends)) for name, ends in free.items()}}
    folder = Path(out or default_run_folder(scene.name))
    check_run_folder(folder, resume)
    effort, identity = _checked_accuracy(scene, settings), run_identity("optimize", scene, **settings)
    further, clock = {}, StageClock()
    if free:
        scene, further["free"] = with_best_values(scene, free_numbers(scene, free), speeds, effort, progress)
    design = scene.required_design
    with clock.stage("bound"):
        kinematic = kinematic_optimum(design, program_cam(design, effort.knot_deg))  # raises for contradictory limits
        bound = area_ratio_bound(design).bound
    with run_folder(folder, identity, resume, ["design.json"]):
        write_text(folder / "scene.toml", scene_toml(scene))
        with Progress(progress, effort, settings["gradient"], compare) as shown:
            job = _OpenRun(scene, settings, effort, clock, folder, shown, compare, further, start)
            job.make_programs()
            lift, verdict, record = job.design(kinematic, bound)
            stated = job.state_yield(lift, verdict)
            with shown.make_room():
                designed(folder)
            job.compared(lift, verdict)
            shown.end()
        job.write_provenance()
    held = verdict.verdict == "confirmed" and (stated is None or stated.confirmed is not False)
    return Run(folder, lift, verdict, record, 0 if held else 3, stated)


def _checked_accuracy(scene: Scene, settings: dict) -> Accuracy:
    """The settings of the accuracy; raises InputError for unknown words."""
    effort = accuracy_named(settings["accuracy"])
    for name, words in (("speeds", SPEEDS), ("gradient", GRADIENTS)):
        if settings[name] not in words:
            raise InputError(f"{name} {settings[name]!r}: expected one of {', '.join(words)}")
    smoothing_in(settings)
    if "yield" in settings:
        check_wanted(scene, settings["yield"], settings["speeds"])
    return effort


@dataclass
class _OpenRun:
    """A run in progress: its settings, its folder, and the contents of its provenance."""

    scene: Scene
    settings: dict
    effort: Accuracy
    clock: StageClock
    folder: Path
    shown: Progress
    compare: bool = True
    further: dict = field(default_factory=dict)  # keys of design.json on free numbers and on the search
    start: Lift | None = None
    search_numbers: dict = field(default_factory=dict)  # numbers of the search, for the provenance

    @cached_property
    def families(self) -> dict[str, Lift | str]:
        """Every family's largest member in the scene."""
        return family_cams(self.scene)

    def make_programs(self) -> None:
        """Compiles the programs on the first run of an installation."""
        if programs_missing():
            self.shown.say(SAYING)
            with self.clock.stage("programs"):
                compile_programs()

    def design(self, kinematic: KinematicOptimum, bound: float) -> tuple[Lift, Verdict, dict]:
        """The cam, its verdict and the content of design.json, all of which are written into the folder."""
        scene, speeds = self.scene, self.settings["speeds"]
        self.shown.begin("search")
        searched, no_jump, failed = self._searched()
        self.shown.begin("verdict")
        with self.clock.stage("verdict"):
            families = None if "yield" in self.settings and searched else self.families
            chosen = largest_confirmed(scene, searched, speeds, self.effort, families, failed)
        cam, why = chosen.cam, chosen.why_a_family(searched, failed)
        lift = as_written(cam.lift)
        record = design_record(
            cam.lift,
            scene.required_design.max_lift_mm * MM,
            area_ratio_bound=bound,
            area_gap_percent=100 * (bound - cam.area_ratio) / bound,
            area_ratio_no_jump=no_jump.area_ratio if no_jump else None,
            gradient_gain=cam.area_ratio - no_jump.area_ratio if no_jump and not why else None,
            verdict_fell_back=chosen.fell_back,
            limit_worth=kinematic.sensitivities,
            **({"why_a_family": why} if why else {}),
            **self.further,
        )
        write_json(self.folder / "design.json", record)
        write_lift_table(self.folder / "lift.csv", lift)
        write_json(self.folder / "verification.json", chosen.verdict.as_dict())
        self.write_provenance()
        return lift, chosen.verdict, record

    def _searched(self) -> tuple[Sequence[CandidateCam], CandidateCam | None, str]:
        """The cams of the search and the best of the program alone; or neither, and the reason why there is none."""
        try:
            return *(self._cams_for_yield() if "yield" in self.settings else self._cams()), ""
        except NoCamFound as failure:
            return [], None, str(failure)

    def _cams(self) -> tuple[Sequence[CandidateCam], CandidateCam | None]:
        """The confirmed cams of the search, each larger than the one before, and the best of the program alone."""
        settings, journal = self.settings, StepFiles(self.folder, cams.FOLDER)
        options = {"start": self.start, "seed": settings["seed"], "smoothing": smoothing_in(settings)}
        options |= {"show": self.shown.step, "clock": self.clock}
        search = find_cam(self.scene, settings["speeds"], self.effort, settings["gradient"], journal=journal, **options)
        self.further["search"], self.search_numbers = search.course, {"cams_judged": search.judge.calls}
        assert search.first is not None, "a search with a cam has ended its first stage"
        return search.confirmed, search.first

    def _cams_for_yield(self) -> tuple[Sequence[CandidateCam], CandidateCam | None]:
        """The same for the search for yield, which has no program alone."""
        from camopt.optimizer.as_built.drawn import FOLDER
        from camopt.optimizer.as_built.search import yield_search

        settings, journal = self.settings, StepFiles(self.folder, FOLDER)
        with self.clock.stage("yield_search"):
            options = {"gradient": settings["gradient"], "seed": settings["seed"], "show": self.shown.step}
            search = yield_search(self.scene, settings["yield"], self.effort, journal=journal, **options)
        self.search_numbers = {"cams_judged": search.steps, "trains_drawn": search.trains_drawn}
        return search.held[-cams.CANDIDATES :], None

    def state_yield(self, lift: Lift, verdict: Verdict) -> "YieldStatement | None":
        """The yield of the cam on fresh trains, which is written into verification.json; None if nothing scatters."""
        from camopt.optimizer.as_built.statement import beside, statement_of_run
        from camopt.optimizer.baselines.comparison import plain_baselines

        def baselines() -> dict[str, Lift | str]:
            options = {"without_jerk_limit": False, "designed": self.families}
            return plain_baselines(self.scene, **options) if self.compare else {}

        self.shown.begin("yield")
        with self.clock.stage("yield"):
            options = {"baselines": baselines, "advance": self.shown.advance}
            stated = statement_of_run(self.scene, lift, self.settings, self.folder, **options)
            further = beside(self.scene, lift, self.settings, stated, self.folder, self.start)
        if stated is not None:
            write_json(self.folder / "verification.json", verdict.as_dict() | {"yield": stated.as_dict() | further})
            self.write_provenance()
        return stated

    def write_provenance(self) -> None:
        """Writes provenance.json with everything that is known so far."""
        content = {
            "versions": {name: version(name) for name in PACKAGES} | {"python": platform.python_version()},
            "machine": {"processor": platform.machine(), "system": platform.system()},
            "settings": self.settings,
            "seed": self.settings["seed"],
            **self.search_numbers,
            "times_s": self.clock.times_s(),
            "stages": self.clock.as_dict(),
            "finished_utc": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        }
        write_json(self.folder / "provenance.json", content)

    def compared(self, lift: Lift, verdict: Verdict) -> None:
        """Writes the comparison with its figures or, if no comparison is wanted, the figures of the design alone."""
        from camopt.optimizer.baselines.comparison import compare_in, plain_baselines  # loads matplotlib
        from camopt.optimizer.baselines.figures import draw

        scene, effort = self.scene, self.effort
        self.shown.begin("comparison")
        with self.clock.stage("comparison"):
            if not self.compare:
                speeds = drawn_speeds(scene.required_operation, effort)
                draw(self.folder, scene, {"design": lift}, {"design": verdict.as_dict()}, speeds)
                return
            options = {"without_jerk_limit": effort.without_jerk_limit, "designed": self.families}
            designs, verdicts, baselines = {"design": lift}, {"design": verdict}, plain_baselines(scene, **options)
            compare_in(self.folder, scene, designs, verdicts, effort, baselines, self.shown.advance)
