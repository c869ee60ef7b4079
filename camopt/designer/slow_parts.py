"""The parts of an answer that take seconds: the certified bound, the literature's cams, and trains as built. They are
functions of an edited scene and its cam alone, so another process can compute them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from camopt.cam.families.free import free_cam
from camopt.cam.lift import Lift
from camopt.designer.cams import KNOT_DEG
from camopt.measure.as_built import trains_as_built
from camopt.measure.limits import broken_by_shape, motion_limits
from camopt.measure.yield_words import share_sentence, spoiling_sentences
from camopt.measure.yields import UsedLimits, share_of, yield_record
from camopt.optimizer.as_built.measured import track
from camopt.optimizer.baselines.comparison import member_or_sentence
from camopt.optimizer.bound.certificate import area_ratio_bound
from camopt.optimizer.program.kinematic import kinematic_optimum
from camopt.scene import InputError, Scene
from camopt.verifier.accuracy import verify

FAMILIES = {"polydyne": "Polydyne", "multi-pol": "Multi-Pol"}
"""Families of the literature's cams that are compared with the design, and their names on the page."""
FEW, MANY = 8, 100
"""Number of trains drawn while the user drags a slider, and once it rests."""
YIELD_SPEEDS = 5
"""Number of speeds of the band at which the drawn trains are judged."""


def bound_part(scene: Scene, lift: Lift) -> dict[str, Any]:
    """The certified bound on the area ratio of every cam under the design's limits."""
    return {"area_ratio_bound": float(area_ratio_bound(scene.required_design).bound)}


def baselines_part(scene: Scene, lift: Lift) -> dict[str, Any]:
    """Area ratio of the literature's cams under the same limits, or the reason why a family has no member."""
    rows = []
    for family, label in FAMILIES.items():
        member = member_or_sentence(scene, family)
        if isinstance(member, str):
            rows.append({"label": label, "area_ratio": None, "says": member})
            continue
        broken = broken_by_shape(member, scene.required_design)
        says = f"breaks {', '.join(broken)}" if broken else ""
        rows.append({"label": label, "area_ratio": float(member.area_ratio_in(scene.required_design)), "says": says})
    return {"baselines": rows}


def trains_of(scene: Scene, lift: Lift, count: int) -> dict[str, Any]:
    """Share of the first `count` drawn trains that hold the limits on the motion, in the words of `camopt yield`."""
    if not motion_limits(scene.design):
        return {"says": "The scene limits nothing of the motion, so every train holds."}
    if not scene.tolerance and scene.grinding is None:
        return {"says": "The scene states no tolerances, so all trains are alike."}
    speeds = np.linspace(*scene.required_operation.band_rpm, YIELD_SPEEDS)
    try:
        usage = track(scene, lift, speeds)
        used = UsedLimits(tuple(usage.limits), speeds, usage.used(trains_as_built(scene, count)))
    except InputError as error:
        return {"says": str(error)}
    record = yield_record(used, share_of(used.holds), 0, {})
    sentences = [share_sentence(record), *spoiling_sentences(record)]
    return {"share": record["share"], "says": f"{'; '.join(sentences)}."}


def why_none(scene: Scene, lift: None) -> dict[str, Any]:
    """Which limits would have to change, and by how much, for a cam to hold all of them."""
    try:
        kinematic_optimum(design := scene.required_design, free_cam(design, KNOT_DEG))
    except InputError as error:
        return {"says": str(error)}
    return {"says": ""}


def verdict_at(scene: Scene, lift: Lift, accuracy: str) -> dict[str, Any]:
    """verification.json of the verdict of `camopt verify` at an accuracy, and its reason."""
    verdict = verify(scene, lift, accuracy=accuracy)
    return {"verification": verdict.as_dict(), "reason": verdict.reason}


WHY = "why"
PARTS: dict[str, Callable[[Scene, Any], dict[str, Any]]] = {
    WHY: why_none,
    "bound": bound_part,
    "baselines": baselines_part,
    "few trains": partial(trains_of, count=FEW),
    "trains": partial(trains_of, count=MANY),
}
"""The slow parts of an answer by name."""
