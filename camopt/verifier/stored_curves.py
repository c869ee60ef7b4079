"""Stored work-precision curves: which setting of a dial gave which error on scenes drawn at random.

`accuracy_curves.json` is written by `python -m experiments.accuracy_curves`, which measures the curves again. A curve
only chooses the setting with which a run begins; the error that a run has delivered is estimated on the run itself.
"""

import json
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

FILE = "accuracy_curves.json"
KEYS = ("setting", "median_um", "p90_um")


@dataclass(frozen=True)
class Curve:
    """Errors [um] at k ascending settings of a dial: the median and the 90th percentile of the draws."""

    unit: str  # of the setting
    setting: np.ndarray
    median_um: np.ndarray
    p90_um: np.ndarray

    def coarsest(self, asked_um: float, typical: bool = False) -> float:
        """The coarsest setting with an error of at most `asked_um` in nine draws out of ten, or in half with `typical`.

        Between the measured settings it is interpolated on the logarithms; it never lies outside them.
        """
        # an erratic curve is read as the largest error at this setting or a finer one
        error = np.maximum.accumulate(self.median_um if typical else self.p90_um)
        least = np.finfo(float).tiny
        rising = np.log(np.maximum(error, least)) + 1e-9 * np.arange(len(error))
        return float(np.exp(np.interp(np.log(asked_um), rising, np.log(self.setting))))


@cache
def stored_curves() -> dict[str, Curve]:
    """The curves in the package by name of the dial: a method, "settling" or "band_step"."""
    text = (resources.files("camopt.verifier") / FILE).read_text(encoding="utf-8")
    curves = json.loads(text)["curves"]
    return {name: Curve(c["unit"], *(np.array(c[k], dtype=float) for k in KEYS)) for name, c in curves.items()}
