"""Natural modes of a valve train with a fixed set of closed contacts, labelled."""

from dataclasses import dataclass

import numpy as np

from camopt.scene import InputError, Scene, build_train
from camopt.scene.vibration import State, acting_elements, oscillations

LEADING = 0.01
"""Component, relative to the largest, from which on it may decide the sign of its shape."""


@dataclass(frozen=True)
class Modes:
    """Oscillating modes (m) of a train of n masses, by ascending frequency."""

    state: str
    frequency_Hz: np.ndarray  # (m), magnitude of the eigenvalue over 2 pi: the undamped frequency where undamped
    angular: np.ndarray  # (m) rad/s
    damping_ratio: np.ndarray  # (m), zero where undamped
    shape: np.ndarray  # (m, n), unit norm, the last component above LEADING positive
    mass_names: tuple[str, ...]
    closed: tuple[str, ...]  # the contacts taken as closed

    def as_dict(self) -> dict:
        """The content of `modes --json`."""
        return {"angular_rad_per_s" if name == "angular" else name: value for name, value in vars(self).items()}

    def plot(self):
        """The mode shapes over the masses as a matplotlib Figure."""
        from camopt.plots import modes as figure

        return figure(self.frequency_Hz, self.shape, self.mass_names, self.state)

    def _repr_html_(self) -> str:
        from pandas import DataFrame

        columns = {"frequency [Hz]": self.frequency_Hz, "damping ratio": self.damping_ratio}
        shapes = dict(zip(self.mass_names, self.shape.T, strict=True))
        return DataFrame(columns | shapes).to_html(float_format="{:.5g}".format)


def modes(scene: Scene, state: State = "lifted") -> Modes:
    """Modes of a scene with the valve lifted off its seat or seated (`camopt.scene.vibration.acting_elements`).

    With damping they are the modes of the damped train: frequency |lambda| / (2 pi), damping ratio -Re(lambda) /
    |lambda|, shape in the phase in which it is largest; overdamped pairs are left out. Raises InputError for an unknown
    state.
    """
    if state not in ("lifted", "seated"):
        raise InputError(f"modes: state {state!r}: expected 'lifted' or 'seated'")
    train = build_train(scene)
    acting = acting_elements(train, state)
    angular, ratio, shape = oscillations(train, acting)
    closed = tuple(train.element_names[e] for e in np.flatnonzero(acting & train.contact))
    return Modes(state, angular / (2 * np.pi), angular, ratio, _normalised(shape), train.mass_names, closed)


def mode_lines(result: Modes) -> list[str]:
    """A line of headings, then a line for each mode, and last the number of overdamped modes, if any."""
    masses = result.mass_names
    lines = [f"{'Hz':>12}  {'rad/s':>12}  {'damping':>8}  " + "  ".join(f"{name:>10}" for name in masses)]
    rows = zip(result.frequency_Hz, result.angular, result.damping_ratio, result.shape, strict=True)
    for hertz, angular, ratio, shape in rows:
        values = "  ".join(f"{value:10.4f}" for value in shape)
        lines.append(f"{hertz:12.6g}  {angular:12.6g}  {100 * ratio:6.2f} %  {values}")
    if overdamped := len(masses) - len(result.frequency_Hz):
        lines.append(f"overdamped: {overdamped} of {len(masses)} modes, damped by more than 100 %: no oscillation")
    return lines


def _normalised(shape: np.ndarray) -> np.ndarray:
    """Shapes (m, n) with unit norm, signed as in the literature's Table 2: the last sizeable component is positive."""
    shape = shape / np.linalg.norm(shape, axis=1)[:, None]
    sizeable = np.abs(shape) >= LEADING * np.abs(shape).max(axis=1)[:, None]
    last = shape.shape[1] - 1 - np.argmax(sizeable[:, ::-1], axis=1)
    return shape * np.sign(shape[np.arange(len(shape)), last])[:, None]
