"""How large a cam keeps its limits in a given share of the trains as built, and with tolerances half or twice as wide?

The search of `camopt optimize --yield` runs on five scenes for five shares of the trains each, and on `kodama` also
with one tolerance left out and with all tolerances half and twice as wide. The yield of each cam is measured on 2000
fresh trains of each of two seeds at 11 speeds over the band, with the interval of Clopper and Pearson. The result also
holds the price list of `camopt yield --price` and, for each family of the literature, the member that comes nearest to
the limits on the motion, with its yield of 2000 trains at the top of the band. An interrupted run can be resumed.

If `CAMOPT_OLDER_TREE` names the folder of an older checkout, its job with `--yield` runs beside this one's on every
scene, and the yield of either cam is measured on 4000 trains of two seeds.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.optimize import differential_evolution

from camopt.cam.families.record import Space
from camopt.cam.families.registry import FAMILIES
from camopt.cam.lift import Lift
from camopt.cam.read import read_cam
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import motion_limits
from camopt.measure.yields import share_of
from camopt.optimizer.accuracy import ACCURACIES
from camopt.optimizer.as_built.measured import track
from camopt.optimizer.as_built.prices import price_list
from camopt.optimizer.as_built.search import yield_search
from camopt.optimizer.as_built.statement import yield_statement
from camopt.optimizer.baselines.largest_member import MemberMotion, family_space, member_within
from camopt.optimizer.stage_clock import StageClock
from camopt.scene import load_scene
from camopt.scene.as_built import scatter_labels, with_scatter
from camopt.scene.design import Design
from experiments.job_time import OLDER_TREE, job
from experiments.support.record import RESULTS, called, run_script, write_result

SCENE = {"small": "motori-1", "full": "kodama"}
WIDTHS = {"small": (1.0,), "full": (0.5, 1.0, 2.0)}
WANTED = {"small": 0.8, "full": 0.99}
SHARES = {"small": (0.7,), "full": (0.9, 0.95, 0.97, 0.99, 0.995)}
LEFT_OUT = {"small": (), "full": ("spring rate", "grinding")}
"""Tolerances that are left out one at a time."""
OTHERS = {"small": (), "full": ("motori-1", "pushrod-5mass", "race-nested", "finger-hydraulic")}
"""Other trains."""
EFFORT = {
    "small": replace(ACCURACIES["draft"], foretold_trains=10, shaping_trains=12, unseen_trains=12),
    "full": ACCURACIES["standard"],
}
PRICED: dict[str, dict] = {"small": {"trains": 4, "sets": 1}, "full": {}}
"""Sizes of the price list other than its own."""
SEARCH = {"small": (1, 2), "full": (30, 8)}
"""Generations of a family's search, and members of each per parameter."""
STATED, SEEDS, SPEEDS = {"small": 10, "full": 2000}, (1_000_007, 3_000_017), 11
"""Fresh trains of each seed that state a cam's yield, which no search has drawn, and speeds over the band."""
BESIDE = {"small": (), "full": (SCENE["full"], *OTHERS["full"])}
BESIDE_TRAINS = 4000
"""Scenes on which an older tree's job runs too, and the trains of each seed that state both cams."""
OF_MEMBERS = {"small": 10, "full": 2000}
"""Of those the ones that state the share of a family's member."""


def cases(size: str) -> list[dict]:
    """The arguments of every search: those with a `scene` are of a share of its trains, with its own tolerances."""
    found: list[dict] = [{"name": f"{width:g}", "width": width} for width in WIDTHS[size]]
    found += [{"name": f"without {label}", "left_out": label} for label in LEFT_OUT[size]]
    found += [
        {"name": f"{scene}, {share:g}", "scene": scene, "wanted": share}
        for scene in (SCENE[size], *OTHERS[size])
        for share in SHARES[size]
        if (scene, share) != (SCENE[size], WANTED[size])  # which is the case of tolerances as given
    ]
    return [case | {"size": size} for case in found]


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """A cam for every width of the tolerances, share and train, and the literature's cams."""
    rows = called("experiments.yield_price:designed", cases(size), size, folder / "yield_price.sqlite")
    content = {
        "wanted": WANTED[size],
        "rows": {row["name"]: row for row in rows if "scene" not in row},
        "shares": by_share(rows, size),
        "prices": priced(size),
        "literature": literature(size),
    }
    if tree := os.environ.get(OLDER_TREE):
        content["beside"] = {scene: beside(scene, tree) for scene in BESIDE[size]}
    return write_result("yield_price", size, content, {}, folder)


def by_share(rows: list[dict], size: str) -> dict[str, dict]:
    """The rows of every train with its own tolerances, by train and share."""
    scenes = [SCENE[size], *OTHERS[size]]
    own = [{"scene": scenes[0]} | row for row in rows if "scene" in row or row["name"] == "1"]
    own.sort(key=lambda row: (scenes.index(row["scene"]), row["wanted"]))
    return {f"{row['scene']}, {100 * row['wanted']:g} %": row for row in own}


def designed(
    name: str,
    size: str,
    width: float = 1.0,
    wanted: float | None = None,
    left_out: str | None = None,
    scene: str | None = None,
) -> dict:
    """The largest cam that a search finds with tolerances of a `width` and one of them `left_out`, what fresh trains
    say of it, and what the search took; of another yield or scene where one is named."""
    wanted = WANTED[size] if wanted is None else wanted
    plain = load_scene(scene or SCENE[size])
    varied = with_scatter(plain, {label: width * (label != left_out) for label in scatter_labels(plain)})
    clock = StageClock()
    with clock.stage("search"):
        search = yield_search(varied, wanted, EFFORT[size])
    assert search.best is not None, "a search that ends has one"
    stated = [
        yield_statement(varied, search.best.lift, wanted, trains=STATED[size], speeds=SPEEDS, seed=seed)
        for seed in SEEDS
    ]
    share = share_of(np.concatenate([statement.used.holds for statement in stated]))
    agrees = [entry["agrees"] for statement in stated for entry in statement.independent]
    return {
        "wanted": wanted,
        "area_ratio": search.best.area_ratio,
        "share": share.share,
        "low": share.low,
        "high": share.high,
        "stated_apart": [statement.share.share for statement in stated],
        "judged_independently": len(agrees),
        "agrees": all(agrees),
        "search_processor_s": clock.as_dict()["search"]["processor_s"],
    }


def beside(scene: str, tree: str) -> dict[str, dict]:
    """What the job for the wanted share takes in an older `tree` and in this one, its programs compiled, and what fresh
    trains of each seed say of its cam."""
    words, rows = ("optimize", scene, "--yield", str(WANTED["full"]), "--seed", "0", "--quiet"), {}
    for name, place in (("older", tree), ("newer", None)):
        with TemporaryDirectory() as held:
            job((*words, "--accuracy", "draft"), Path(held, "draft"), {}, place)  # which compiles
            rows[name] = job(words, out := Path(held, "run"), {}, place) | {"shares": fresh_shares(scene, out)}
    return rows


def fresh_shares(scene: str, run: Path) -> list[dict]:
    """What so many fresh trains of each seed say of a job's cam."""
    loaded = load_scene(scene)
    cam, size = read_cam(run, loaded), {"trains": BESIDE_TRAINS, "speeds": SPEEDS, "sample": 0}
    return [vars(yield_statement(loaded, cam, None, seed=seed, **size).share) for seed in SEEDS]


def priced(size: str) -> dict:
    """The price list at the wanted share, and what it took; at small size of two tolerances."""
    scene, clock = load_scene(SCENE[size]), StageClock()
    left_out = scatter_labels(scene)[2:] if size == "small" else ()
    with clock.stage("prices"):
        found = price_list(with_scatter(scene, dict.fromkeys(left_out, 0.0)), WANTED[size], **PRICED[size])
    return found.as_dict() | {"processor_s": clock.as_dict()["prices"]["processor_s"]}


def literature(size: str) -> dict[str, dict]:
    """Of each family the member that uses least of the limits on the motion, and its yield.

    Members keep the limits on the shape, that on jerk apart; those of some families cannot. The search asks the train
    as designed at the top of the band, and the yield is that of the fresh trains there.
    """
    scene = load_scene(SCENE[size])
    top = scene.required_operation.band_rpm[1]
    motion, limits = MemberMotion(scene, [top]), motion_limits(scene.required_design).values()
    design = scene.required_design.model_copy(update={"jerk_max_mm_per_deg3": None})
    trains = trains_as_built(scene, OF_MEMBERS[size], seed=SEEDS[0])

    def worst_part(lift: Lift) -> float:
        figures = motion.worst(lift)
        return max(float(limit.share(np.array(figures[limit.metric]))) for limit in limits)

    found = {}
    for family in FAMILIES:
        members = within(family_space(scene, family, jerk=False), design, worst_part, size)
        if members:
            uses, lift = min(members, key=lambda pair: pair[0])
            share = share_of(track(scene, lift, [top]).used(trains).max(axis=(1, 2)) <= 1.0)
            area = lift.area_ratio_in(scene.required_design)
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
