"""`camopt.ascend`: ascent along an objective's gradient by an optax transformation, within the limits on the shape.

Before a step the gradient is projected onto the face of the limits on which the point lies (Rosen 1960), and the step
that the transformation returns is projected onto the same face. A transformation that scales every variable separately,
such as Adam, therefore still ascends, and momentum does not push against a limit. The new point is then replaced by the
nearest one that holds every limit (Goldstein 1964; Levitin and Polyak 1966). If the objective has path constraints,
their augmented Lagrangian is maximised in its place, and the transformation is restarted in each of its rounds.
"""

import json
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import optax
from tqdm import tqdm

from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape
from camopt.optimizer.ascent.history import AscentHistory, Iterate, dataset_of, notable
from camopt.optimizer.ascent.lagrangian import PathLagrangian, Round
from camopt.optimizer.ascent.objective import Objective
from camopt.optimizer.ascent.variables import FREE, FamilyVariables, FreeVariables, Names, TrainVariables, Variables
from camopt.optimizer.program.program_cam import program_cam
from camopt.optimizer.search.judge import Judge
from camopt.scene.errors import InputError
from camopt.scene.schema import Scene
from camopt.storage import check_run_folder, run_folder, run_identity, write_text

FORMS = (FREE, "own")
STATE = "ascent.json"
ROUND = 30
"""Number of steps between two updates of the multipliers, enough for a quasi-Newton method to estimate the curvature.
"""
Point = dict[str, np.ndarray]


def ascend(
    objective: Objective,
    start: Lift | Literal["calmest"],
    optimiser: optax.GradientTransformation,
    steps: int = 50,
    *,
    form: str = FREE,
    knot_deg: float = 3.0,
    train: Mapping[Names, tuple[float, float]] | None = None,
    judge_every: int = 5,
    metric: bool = False,
    out: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
) -> AscentHistory:
    """Maximises an objective from a start cam by `steps` steps of an optax transformation; returns every iterate.

    With `form` "free" the variables are the coefficients [mm/deg^2] of the free cam within the limits that is nearest
    to `start`. Its knots are `knot_deg` apart, but a free cam keeps its own knots. The start "calmest" is the free cam
    whose coefficients are zero. With `form` "own" the variables are factors on the parameters of the start's own
    family. `train` names numbers of the scene that vary as well, NAME.KEY or several that share one factor, with the
    bounds of that factor, as in {("spring.preload_N", "seat.preload_N"): (0.9, 1.1)}. Every iterate holds the limits on
    the shape. Every `judge_every`-th iterate and the last one are simulated by event-exact at the objective's speeds
    until the motion has settled. `history.best` is the judged cam of the largest objective that holds every limit, None
    if there is none; `history.nearest` is the judged cam whose largest used share of a limit is smallest. With `out` a
    folder is written after every judged iterate. With `resume` the ascent in that folder is continued as if it had not
    been interrupted, and `steps` may be larger than before.

    Path constraints of the objective are met in rounds of thirty steps by an augmented Lagrangian. The transformation
    is restarted in each round, and the terms of an iterate include the least force and the largest gap. With `metric`
    the steps are taken in scaled coordinates, in which a step of length one moves the constrained paths by one unit (a
    gap's limit, the median force of the start). The scaling comes from one Jacobian at the start and serves any
    transformation.

    Raises InputError for unusable arguments, contradictory limits, a family without a member near `start` that holds
    them, a motion that cannot be computed, and for a folder as `camopt.storage.run_folder`.
    """
    if form not in FORMS or steps < 1 or judge_every < 1:
        raise InputError(
            f"ascend: form {form!r}, steps {steps}, judge_every {judge_every}: expected {' or '.join(FORMS)}, and "
            f"numbers from 1 on"
        )
    if out is not None:
        check_run_folder(out, resume)
    _check_constraints(objective, start, form, train, metric)
    numbers = TrainVariables(objective.scene, dict(train or {}))
    begin = calmest(objective.scene, knot_deg) if isinstance(start, str) else start
    cam = FreeVariables(objective.scene, begin, knot_deg) if form == FREE else FamilyVariables(objective.scene, begin)
    variables = Variables(cam, numbers)
    ascent = AscentState(objective, variables, optimiser, metric)
    identity = run_identity(
        "ascend",
        objective.scene,
        **{name: value for name, value in vars(objective).items() if name != "scene"},
        start=variables.start["cam"],
        form=form,
        train=dict(zip(numbers.names, numbers.bounds.values(), strict=True)),
        optimiser=str(jax.tree.structure(ascent.state)),
        judge_every=judge_every,
        metric=metric,
    )
    with run_folder(out, identity, resume, [STATE]) if out is not None else nullcontext() as folder:
        if folder is not None and (folder / STATE).exists():
            ascent.load(folder / STATE)
        begun, bar = len(ascent.iterates), tqdm(total=steps + 1, disable=None if progress else True, dynamic_ncols=True)
        with bar:
            bar.update(begun)
            for number in range(begun, steps + 1):
                ascent.step(judged=number % judge_every == 0 or number == steps)
                bar.update(1)
                bar.set_description(str(ascent.iterates[-1]), refresh=False)
                if folder is not None and ascent.iterates[-1].judged:
                    ascent.save(folder / STATE)
        history = ascent.history()
        if folder is not None:
            history.write(folder)
    return history


class AscentState:
    """State of an ascent: the current point, the state of the optax transformation, and the iterates so far."""

    def __init__(
        self, objective: Objective, variables: Variables, optimiser: optax.GradientTransformation, metric: bool
    ):
        self.objective, self.variables = objective, variables
        self.iterates: list[Iterate] = []
        self._bound = objective.of(variables.cam.template, variables.train)
        self._optimiser = optax.with_extra_args_support(optimiser)
        self._lagrangian = PathLagrangian(self._bound) if objective.constraints else None
        self._round: Round | None = None
        if self._lagrangian is not None:
            parameters, start = variables.cam.parameters, variables.cam.start
            self._round = self._lagrangian.begin(parameters(start), variables.cam.lift(start))
            if metric:
                scale = self._lagrangian.metric(parameters, start, self._round)
                self.variables = Variables(variables.cam, variables.train, scale)
        self.point: Point = self.variables.start
        self._restart()
        self._slopes = jax.jit(jax.value_and_grad(self._value, has_aux=True))

    def _restart(self) -> None:
        """Restarts the transformation at the current point."""
        self.state = _typed(self._optimiser.init(jax.tree.map(jnp.asarray, self.point)))

    def _value(self, point: Mapping[str, jax.Array], current: Round | None) -> tuple[jax.Array, tuple[Any, ...]]:
        """The function that is maximised, and with it the objective's value, its terms and any constrained paths."""
        parameters = self.variables.parameters(point)
        value, terms = self._bound.value_and_terms(parameters)
        if self._lagrangian is None or current is None:
            return value, (value, terms, None)
        maximised, worst, paths = self._lagrangian(value, parameters, current)
        return maximised, (value, terms | worst, paths)

    def _move(self, maximised: jax.Array, gradient: Point, faces: Point) -> Point:
        """The point reached by the transformation's step along the faces; the transformation's state is updated.

        The transformation's own arithmetic is not compiled. A compiled line search would contain the objective in every
        branch, and that program would take long to compile in every process.
        """

        def along(faces, change):
            return {name: faces[name] @ array for name, array in change.items()}

        def loss_and_slopes(trial):  # minus the objective at the nearest point within the limits, and its slopes
            step = along(faces, {name: np.asarray(array) - self.point[name] for name, array in trial.items()})
            moved = {name: self.point[name] + array for name, array in step.items()}
            nearest, projectors = self.variables.nearest_and_faces(moved)
            with jax.disable_jit(False):
                (value, _), slopes = self._slopes(nearest, self._round)
            return -value, along(faces, along(projectors, jax.tree.map(jnp.negative, slopes)))

        loss = jax.custom_vjp(lambda trial: loss_and_slopes(trial)[0])
        loss.defvjp(loss_and_slopes, lambda slopes, bar: (jax.tree.map(lambda array: bar * array, slopes),))
        point = jax.tree.map(jnp.asarray, self.point)
        downhill = jax.tree.map(jnp.asarray, along(faces, jax.tree.map(np.negative, gradient)))
        with jax.disable_jit():
            line_search = {"value": -maximised, "grad": downhill, "value_fn": loss}
            change, state = self._optimiser.update(downhill, self.state, point, **line_search)
        self.state = _typed(state)
        return {name: self.point[name] + array for name, array in along(faces, change).items()}

    def step(self, judged: bool) -> None:
        """Records the current point as an iterate, and moves to the next one."""
        if self._lagrangian is not None and self.iterates and len(self.iterates) % ROUND == 0:
            self._next_round(self._lagrangian)
        (maximised, (value, terms, paths)), gradient = self._slopes(self.point, self._round)
        gradient = jax.tree.map(np.asarray, gradient)
        if not np.all([np.isfinite(array).all() for array in (maximised, *gradient.values())]):
            raise InputError(
                f"ascend: the motion of iterate {len(self.iterates)} or its gradient cannot be followed on the "
                f"{self.objective.source} source: take smaller steps, another start or the other source"
            )
        faces = self.variables.faces(self.point, gradient)
        norm = np.sqrt(sum(float(np.sum((faces[name] @ slopes) ** 2)) for name, slopes in gradient.items()))
        share = self._judged_share() if judged else np.nan
        terms = {name: float(term) for name, term in terms.items()}
        cam = self.variables.cam_vector(self.point)
        self.iterates.append(Iterate(float(value), terms, norm, share, cam, self.point["train"]))
        self.point = self.variables.nearest(self._move(maximised, gradient, faces))
        if self._round is not None:
            self._round = self._round._replace(start=paths.end)

    def _next_round(self, lagrangian: PathLagrangian) -> None:
        """Updates the Lagrangian and restarts the transformation, whose state belongs to another function."""
        assert self._round is not None
        (_, (_, _, paths)), _ = self._slopes(self.point, self._round)
        self._round = lagrangian.next(self.variables.lift(self.point), self._round, paths)
        self._restart()

    def _judged_share(self) -> float:
        """The largest used share of a limit of the settled event-exact motion; infinite if the shape breaks a limit."""
        scene, lift = self.variables.train.scene_with(self.point["train"]), self.variables.lift(self.point)
        if broken_by_shape(lift, scene.design):
            return np.inf
        return float(Judge(scene, sorted(self.objective.speeds_rpm))(lift).share.max(initial=0.0))

    def history(self) -> AscentHistory:
        """All iterates so far, with the best and the nearest of them."""
        about = {"scene": self.objective.scene.name, "path": self.objective.source, "maximise": self.objective.maximise}
        steps = notable(self.iterates)
        data = dataset_of(self.iterates, self.variables.train.names).assign_attrs(about, **steps)
        cams = {}
        for name, step in steps.items():
            iterate = self.iterates[step]
            cams[name] = self.variables.cam.lift(iterate.cam), self.variables.train.scene_with(iterate.train)
        return AscentHistory(data, *cams["nearest"], *cams.get("best", (None, None)))

    def save(self, path: Path) -> None:
        """Writes the state of the ascent, from which `load` continues it to the last digit."""
        iterates, state = [vars(iterate) for iterate in self.iterates], jax.tree.leaves((self.state, self._round))
        content = {"iterates": iterates, "point": self.point, "state": state}
        write_text(path, json.dumps(content, default=lambda array: np.asarray(array).tolist()))

    def load(self, path: Path) -> None:
        """Restores what `save` wrote of the same ascent."""
        stored = json.loads(path.read_text(encoding="utf-8"))
        leaves, tree = jax.tree.flatten((self.state, self._round))
        pairs = zip(leaves, stored["state"], strict=True)
        values = [jnp.asarray(value, dtype=leaf.dtype).reshape(leaf.shape) for leaf, value in pairs]
        self.state, self._round = jax.tree.unflatten(tree, values)
        self.point = {name: np.array(array, dtype=float) for name, array in stored["point"].items()}
        rows = stored["iterates"]
        arrays = [{name: np.array(row[name], dtype=float) for name in ("cam", "train")} for row in rows]
        self.iterates = [Iterate(**row | vectors) for row, vectors in zip(rows, arrays, strict=True)]


def calmest(scene: Scene, knot_deg: float) -> Lift:
    """The free cam of a design whose coefficients are zero."""
    free = program_cam(scene.required_design, knot_deg)
    return free.lift(np.zeros(free.Z.shape[1]))


def _check_constraints(objective: Objective, start, form: str, train, metric: bool) -> None:
    """Raises InputError for a start, form, train or metric that does not go with the others or the constraints."""
    if isinstance(start, str) and start != "calmest":
        raise InputError(f"ascend: start {start!r}: expected a cam, as camopt.polydyne(scene) gives, or 'calmest'")
    if isinstance(start, str) and form != FREE:
        raise InputError(f"ascend: start 'calmest' with form={form!r}: it is a free cam: take form='free'")
    if metric and (form != FREE or not objective.constraints):
        raise InputError(
            f"ascend: metric=True with form={form!r} and constraints {objective.constraints}: it is that of a free cam "
            f"by the slopes of constraints: take form='free', and give objective() constraints"
        )
    if train and objective.constraints:
        raise InputError("ascend: train with constraints: they hold for the train as designed: leave one of them out")


def _typed(state: Any) -> Any:
    """The state with fixed types, so that the second step is not compiled again."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=jnp.asarray(leaf).dtype), state)
