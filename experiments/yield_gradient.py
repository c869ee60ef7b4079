"""What do gradients add to a cam that 99 of 100 trains as built of `kodama` hold?

    python -m experiments.yield_gradient [small|full]

The search for a yield with ten seeds, which draw all its trains, at a smaller effort than `--accuracy standard` has:
800 trains shape the cam, and 2000 others say how large it may be. Each search ends with two cams: one whose margins
were moved by groups, for which nothing was differentiated, and one whose margins then followed exact slopes. A run
keeps the larger one. An interrupted run goes on.
"""

from pathlib import Path

import numpy as np

from camopt.optimizer.as_built.design import YieldEffort, yield_search
from camopt.scene import load_scene
from experiments.support.record import RESULTS, run_script, write_result
from experiments.support.sweeping import called

SCENE = {"small": "motori-1", "full": "kodama"}
WANTED = {"small": 0.8, "full": 0.99}
EFFORT = {"small": YieldEffort(6, 0, 1, 1, 10, 0, 0), "full": YieldEffort(300, 8, 12, 8, 2000, 0, 0)}
SEEDS = {"small": 2, "full": 10}


def main(size: str = "full", folder: Path = RESULTS) -> dict:
    """Both cams of a search for every seed."""
    cases = ({"seed": seed, "size": size} for seed in range(SEEDS[size]))
    rows = called("experiments.yield_gradient:sought", cases, size, folder / "yield_gradient.sqlite")
    gains = [row["area_ratio"] - row["without_gradients_area_ratio"] for row in rows]
    content = {
        "seeds": {f"{row['seed']}": row for row in rows},
        "gain": {"mean": float(np.mean(gains)), "spread": float(np.std(gains, ddof=1))},
    }
    write_result("yield_gradient", size, content, {}, folder)
    return content


def sought(seed: int, size: str) -> dict:
    """The area ratios of one search with and without the steps along slopes."""
    search = yield_search(load_scene(SCENE[size]), WANTED[size], EFFORT[size], seed=seed)
    best, plain = search.best, search.without_gradients
    assert best is not None and plain is not None, "a search that ends has both"
    return {"area_ratio": best.area_ratio, "without_gradients_area_ratio": plain.area_ratio}


if __name__ == "__main__":
    run_script(main, __doc__)
