"""How large a cam do 99 of 100 trains as built hold, with tolerances half as wide, as given, and twice as wide?

    python -m experiments.yield_price [small|full]

`camopt optimize kodama --yield 0.99` at effort standard for each width of the tolerances; for the given one also with
one margin at all speeds, with a spring of 5 % more preload, and for 97 of 100 trains. Each cam is stated by 2000 fresh
trains at 21 speeds over the band, with the interval of Clopper and Pearson. Beside them stands of each family of the
literature the member that comes nearest to the limits on the motion. An interrupted run goes on.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from camopt.cam.families.record import Space
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import motion_limits
from camopt.measure.yields import share_of
from camopt.optimizer.as_built.design import EFFORTS, YieldEffort, yield_search
from camopt.optimizer.as_built.statement import yield_statement
from camopt.optimizer.as_built.track import track
from camopt.optimizer.baselines.family_spaces import family_space
from camopt.optimizer.baselines.largest_member import MemberLimits, MemberMotion, member_within
from camopt.scene import Scene, load_scene
from camopt.scene.design import Design
from camopt.scene.valve_spring import with_spring
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

SCENE = {"small": "motori-1", "full": "kodama"}
WIDTHS = {"small": (1.0,), "full": (0.5, 1.0, 2.0)}
WANTED = {"small": 0.8, "full": 0.99}
EFFORT = {"small": YieldEffort(6, 0, 1, 1, 10, 4, 3), "full": EFFORTS["standard"]}
ONE_MARGIN, MORE_PRELOAD, LESS_ASKED = "one margin", "preload 5 % more", "97 % asked"
SEARCH = {"small": (1, 2), "full": (30, 8)}
"""Generations of a family's search, and members of each per parameter."""
STATED, STATED_SEED = {"small": 10, "full": 2000}, 1_000_007
"""Fresh trains that state a cam's yield, which no search has drawn."""


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """A cam for every width of the tolerances, and the literature's cams."""
    cases = [{"name": f"{width:g}", "width": width} for width in WIDTHS[size]]
    cases += [{"name": ONE_MARGIN, "shaped": False}, {"name": MORE_PRELOAD, "preload": 1.05}]
    cases += [{"name": LESS_ASKED, "wanted": 0.97}] if size == "full" else []
    tasks = (case | {"size": size} for case in cases)
    rows = called("experiments.yield_price:designed", tasks, size, folder / "yield_price.sqlite")
    content = {
        "wanted": WANTED[size],
        "rows": {row["name"]: row for row in rows},
        "literature": literature(size),
    }
    write_result("yield_price", size, content, {}, folder)
    return content


def designed(
    name: str, size: str, width: float = 1.0, shaped: bool = True, preload: float = 1.0, wanted: float | None = None
) -> dict:
    """The largest cam that a search finds with tolerances of a `width` and so many times the preload, by margins that
    are `shaped` or one margin for all speeds, and what fresh trains say of it; of another yield where one is `wanted`.
    """
    wanted = WANTED[size] if wanted is None else wanted
    scene, effort = with_spring(scattered(load_scene(SCENE[size]), width), preload=preload), EFFORT[size]
    asked = effort if shaped else replace(effort, moves=0)
    best = yield_search(scene, wanted, asked, gradient=shaped).best
    assert best is not None, "a search that ends has one"
    stated = yield_statement(
        scene, best.lift, wanted, trains=STATED[size], speeds=effort.stated_speeds, seed=STATED_SEED
    )
    agrees, share = all(entry["agrees"] for entry in stated.independent), stated.share
    return {
        "area_ratio": best.area_ratio,
        "share": share.share,
        "low": share.low,
        "high": share.high,
        "agrees": agrees,
    }


def scattered(scene: Scene, width: float) -> Scene:
    """The scene with all its tolerances, grinding included, so many times as wide."""
    wider = tuple(
        t.model_copy(update={key: width * getattr(t, key) for key in ("relative", "plus_minus") if getattr(t, key)})
        for t in scene.tolerance
    )
    grinding = scene.grinding and scene.grinding.model_copy(update={"error_um": width * scene.grinding.error_um})
    return scene.model_copy(update={"tolerance": wider, "grinding": grinding})


def literature(size: str) -> dict[str, dict]:
    """Of each family the member that uses least of the limits on the motion, and its yield.

    Members keep the limits on the shape, that on jerk apart; those of some families cannot. The search asks the train
    as designed at the top of the band, and the yield is that of the fresh trains there.
    """
    scene = load_scene(SCENE[size])
    assert scene.design is not None and scene.operation is not None, "the scene has both"
    top = scene.operation.band_rpm[1]
    motion, limits = MemberMotion(scene, [top]), motion_limits(scene.design).values()
    design, trains = MemberLimits(jerk=False).design(scene), trains_as_built(scene, STATED[size], seed=STATED_SEED)

    def worst_part(lift: Lift) -> float:
        figures = motion.worst(lift)
        return max(float(limit.share(np.array(figures[limit.metric]))) for limit in limits)

    found = {}
    for family in FAMILIES:
        members = within(family_space(scene, family, jerk=False), design, worst_part, size)
        if members:
            uses, lift = min(members, key=lambda pair: pair[0])
            share = share_of(track(scene, lift, [top]).used(trains).max(axis=(1, 2)) <= 1.0)
            area = lift.area_ratio_in(scene.design)
            found[family] = {"area_ratio": area, "uses": uses, "share": share.share, "high": share.high}
    return found


def within(space: Space, design: Design, worst_part: Callable[[Lift], float], size: str) -> list[tuple[float, Lift]]:
    """The members within the design's limits on the shape that a search for the least `worst_part` meets, each with
    its own."""
    found: list[tuple[float, Lift]] = []

    def cost(x: np.ndarray) -> float:
        lift, too_much = member_within(space, x, design)
        if lift is None:
            return too_much
        uses = worst_part(lift)
        found.append((uses, lift))
        return uses / (1.0 + uses) if np.isfinite(uses) else 1.0

    if space.bounds:
        generations, population = SEARCH[size]
        differential_evolution(
            cost,
            space.bounds,
            maxiter=generations,
            popsize=population,
            init="sobol",
            x0=space.known[0] if space.known else None,
            polish=False,
            rng=np.random.default_rng(0),
        )
    else:
        cost(np.zeros(0))
    return found


if __name__ == "__main__":
    run_script(main, __doc__)
