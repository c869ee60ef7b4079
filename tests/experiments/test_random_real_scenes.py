"""Drawn trains of real elements: the draws hold what they say, and the small size finds nothing wrong."""

import numpy as np

from camopt.study.extremes.classification import REFUSED, WITHIN
from experiments.random_scenes import REAL, judged
from experiments.support.drawn_scenes import REAL_BASES, drawn


def test_draws_move_every_kind_of_number():
    scenes = [drawn(np.random.default_rng([7, i]), real=True)[0] for i in range(30)]
    assert {scene.name.removesuffix("-moved") for scene in scenes} == set(REAL_BASES)
    of = {key: {getattr(e, key) for s in scenes for e in s.element} - {None} for key in ("leak_N_s_per_m", "slip_N")}
    assert all(len(values) > 4 for values in of.values())
    assert len({s.force[0].table for s in scenes if s.force}) > 2
    assert len({e.force_table for s in scenes for e in s.element if e.force_table}) > 2


def test_nothing_is_wrong_without_a_warning():
    rows = [judged(REAL + i, cams=1) for i in (9, 10, 13)]  # an adjuster, gas force, nested springs: the quickest ones
    assert [row["verdict"] for row in rows] == [WITHIN, WITHIN, REFUSED]
