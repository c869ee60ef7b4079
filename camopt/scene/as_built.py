"""Manufacturing scatter: the numbers of a scene that its tolerances change, and their random draws.

The draws are common random numbers: those of train i depend only on the seed, on i and on the tolerance's label. A
larger ensemble thus begins with a smaller one's trains, and another width of a tolerance leaves every draw as it was.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from functools import lru_cache

import numpy as np

from camopt.scene.errors import did_you_mean
from camopt.scene.parameters import KEYS, SceneNumber, has_wildcards, matching, with_numbers
from camopt.scene.schema import Scene, Tolerance
from camopt.scene.text_file import excerpt
from camopt.scene.train import SceneKey

REACH = 4.0
"""Standard deviations at which normal draws are cut off; one draw in 16 000 exceeds them, and is not built in."""
MAY_BE_NEGATIVE = ("force_N", "preload_N")
MAY_BE_ZERO = ("damping_N_s_per_m", "gap_mm", "installed_mm", "check_travel_mm")
GRINDING = "grinding"
"""Label of the scene's grinding error in results."""


def moved_together(scene: Scene, tolerance: Tolerance) -> list[list[SceneNumber]]:
    """The numbers that a tolerance changes, in lists of those that share one draw."""
    numbers = _numbers_named(SceneKey(scene), *tolerance.numbers)
    if isinstance(tolerance.of, str):
        return [[number] for number in numbers]
    return [list(dict.fromkeys(numbers))]


@lru_cache(maxsize=64)
def _numbers_named(key: SceneKey, *texts: str) -> list[SceneNumber]:
    """The numbers that texts NAME.KEY refer to, cached because every drawn train needs them."""
    return [number for text in texts for number in matching(key.scene, text)]


def deviates(scene: Scene, seed: int, train: int) -> dict[str, np.ndarray]:
    """Draws (k) of the train with this number, by tolerance label, in units of the width that the tolerance states."""
    draws = {}
    for tolerance in scene.tolerance:
        count = len(moved_together(scene, tolerance))
        random = np.random.default_rng(key_of(seed, train, tolerance.label))
        if tolerance.distribution == "uniform":
            draws[tolerance.label] = random.uniform(-1.0, 1.0, count)
        else:
            draws[tolerance.label] = np.clip(random.standard_normal(count), -REACH, REACH)
    return draws


def key_of(seed: int, train: int, label: str) -> tuple[int, int, int]:
    """Seed of the draws of one train for one label."""
    return seed, train, zlib.crc32(label.encode())


def scene_as_built(scene: Scene, draws: Mapping[str, np.ndarray]) -> Scene:
    """The scene with its numbers changed by the `draws` of `deviates`."""
    factor, summand = defaultdict(lambda: 1.0), defaultdict(float)
    for tolerance in scene.tolerance:
        for numbers, draw in zip(moved_together(scene, tolerance), draws[tolerance.label], strict=True):
            for number in numbers:
                if tolerance.plus_minus is not None:
                    summand[number] += tolerance.plus_minus * float(draw)
                    continue
                share = (tolerance.relative or 0.0) * float(draw)
                factor[number] *= float(np.exp(share)) if tolerance.distribution == "lognormal" else 1.0 + share
    values = {n: n.of(scene) * factor[n] + summand[n] for n in dict.fromkeys([*factor, *summand])}
    return with_numbers(scene, values)


def scatter_labels(scene: Scene) -> list[str]:
    """Labels of everything that scatters in a scene: its tolerances, and GRINDING if it has a grinding error."""
    return [tolerance.label for tolerance in scene.tolerance] + [GRINDING] * (scene.grinding is not None)


def with_scatter(scene: Scene, factors: Mapping[str, float]) -> Scene:
    """The scene with the widths of its tolerances multiplied by `factors`, by label, GRINDING included. A factor of
    zero removes a tolerance. The draws of all others stay the same."""
    rows = []
    for tolerance in scene.tolerance:
        factor = factors.get(tolerance.label, 1.0)
        widths = {key: getattr(tolerance, key) for key in ("relative", "plus_minus")}
        wide = {key: factor * width for key, width in widths.items() if width is not None}
        rows += [tolerance.model_copy(update=wide)] if factor else []
    grinding, factor = scene.grinding, factors.get(GRINDING, 1.0)
    if grinding is not None:
        grinding = grinding.model_copy(update={"error_um": factor * grinding.error_um}) if factor else None
    return scene.model_copy(update={"tolerance": tuple(rows), "grinding": grinding})


def tolerance_faults(scene: Scene) -> list[str]:
    """One sentence per fault in the tolerances of a scene whose masses and elements have no fault."""
    faults, labels = [], [tolerance.label for tolerance in scene.tolerance]
    for i, tolerance in enumerate(scene.tolerance, 1):
        faults_of_names = [_fault_of_name(scene, tolerance, text) for text in tolerance.numbers]
        faults += [f"tolerance.{i}.of: {fault}" for fault in faults_of_names if fault]
        if tolerance.label in (GRINDING, *labels[: i - 1]):
            what = "[grinding]" if tolerance.label == GRINDING else "an earlier tolerance"
            faults.append(f"tolerance.{i}: {what} is called {excerpt(tolerance.label)} too: give this one another name")
    return faults or [*_too_wide(scene)]


def _fault_of_name(scene: Scene, tolerance: Tolerance, text: str) -> str:
    """Why a text NAME.KEY of a tolerance is unusable, or an empty text."""
    name, dot, key = text.rpartition(".")
    if not dot:
        return f'{excerpt(text)} is not NAME.KEY, such as "spring.stiffness_N_per_m"'
    homes = [table for table in KEYS if any(fnmatchcase(row.name, name) for row in getattr(scene, table))]
    if not homes:
        names = [row.name for table in KEYS for row in getattr(scene, table)]
        return f"no mass or element is named {excerpt(name)}{did_you_mean(name, names)}"
    keys = [key for table in homes or KEYS for key in KEYS[table]]
    if key not in keys:
        has = f"no mass or element {name!r} has a" if has_wildcards(name) else f"the {homes[0]} {name!r} has no"
        expected = did_you_mean(key, keys) or f": expected {' or '.join(dict.fromkeys(keys))}"
        return f"{has} number {excerpt(key)} that may scatter{expected}"
    numbers = matching(scene, text)
    if not has_wildcards(name) and len(numbers) > 1:
        return f"{excerpt(text)} is a number of a mass and of an element: give one of them another name"
    if any(number.of(scene) is None for number in numbers):
        return f"{excerpt(text)}: no number there to scatter"
    if tolerance.relative is not None and any(number.of(scene) == 0.0 for number in numbers):
        return f"{excerpt(text)} is 0, and a share of 0 is 0: give plus_minus in its unit in place of relative"
    if tolerance.plus_minus is not None and len({text.rpartition(".")[2] for text in tolerance.numbers}) > 1:
        return f"{excerpt(text)} differs in its key from others here, and plus_minus has one unit: give relative"
    return ""


def _too_wide(scene: Scene) -> Iterator[str]:
    """Sentences on numbers that a draw could make negative, and on tolerances larger than their number."""
    share, absolute, of = defaultdict(lambda: 1.0), defaultdict(float), {}
    for i, tolerance in enumerate(scene.tolerance, 1):
        reach = 1.0 if tolerance.distribution == "uniform" else REACH
        for number in (n for numbers in moved_together(scene, tolerance) for n in numbers):
            of[number] = i
            value = abs(number.of(scene))
            if tolerance.plus_minus is not None:
                absolute[number] += reach * tolerance.plus_minus
                if 0.0 < value < tolerance.plus_minus:
                    yield (
                        f"tolerance.{i}.plus_minus: {tolerance.plus_minus:g} is more than {number.named(scene)} = "
                        f"{value:g} itself: check the unit"
                    )
            elif tolerance.distribution != "lognormal" and tolerance.relative is not None:
                share[number] *= max(0.0, 1.0 - reach * tolerance.relative)
    for number, i in of.items():
        lowest = share[number] * number.of(scene) - absolute[number]
        if number.key in MAY_BE_NEGATIVE or lowest > 0.0 or (lowest == 0.0 and number.key in MAY_BE_ZERO):
            continue
        yield (
            f"tolerance.{i}: {number.named(scene)} = {number.of(scene):g} could be drawn as low as {lowest:.3g} ("
            f"normal draws reach {REACH:g} standard deviations): make the tolerance narrower, or lognormal"
        )
