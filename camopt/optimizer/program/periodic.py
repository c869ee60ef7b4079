"""Periodic motion of a train whose contacts switch at given cam angles: linear in the cam, one solve per speed.

Within a phase (see `phases`) the same contacts stay closed and may even pull. The motion is therefore linear with
constant matrices, and its steady periodic response is affine in the cam's free coefficients. Each step is exact: the
lift is a polynomial on it, so that its derivatives are further states, and one matrix exponential advances both motion
and lift (Van Loan, IEEE Trans. Automatic Control 23, 1978). Steps of one kind on one piece of the cam form a block,
which a power of the step's matrix crosses at once. States inside a block are evaluated only where they are needed.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.linalg import expm
from scipy.special import factorial

from camopt.cam.families.free import FreeCam
from camopt.cam.lift import Lift
from camopt.optimizer.program.phases import Angles, Tangents, phase_contacts
from camopt.scene.rest import linearised_at_rest
from camopt.scene.train import Train
from camopt.scene.units import DEG

LIFT_DERIVATIVES = 7
"""Number of lift derivatives in a step's state, the lift included: the ramps' feet are polynomials of degree six."""
SAMPLE = 0.25 * DEG
"""Longest step between samples of the motion [rad]."""
LONGEST = 16
"""Largest number of steps in a block: with more steps, powers of their matrix cost more than they save."""


@dataclass(frozen=True)
class CamSamples:
    """Samples of the cam for all speeds: step edges (k + 1) [rad] from -pi to pi, and the lift by blocks of steps.

    The steps from the edge `first` (b) to that of the next block are equal in phase, width and tangents, and lie on one
    piece of the cam. `begin` (b, 8, 1 + m) contains that piece's lift at the edge, its six derivatives by angle and the
    constant one: in column 0 for the cam at z = 0 or another lift, and in the others for every free coefficient.
    """

    edges: np.ndarray
    first: np.ndarray
    begin: np.ndarray


def sample_cam(cam: FreeCam, angles: Angles, step: float = SAMPLE, about: Lift | None = None) -> CamSamples:
    """Steps of at most `step` [rad] whose edges include every knot, ramp border and switching angle. With `about`, a
    lift of pieces of degree six at most, column 0 is for it, and the edges include every `step` from -pi on."""
    knot = cam.breaks[1] - cam.breaks[0]
    fine, start = (knot / np.ceil(knot / step - 1e-9), cam.breaks[0]) if about is None else (step, -np.pi)
    uniform = start + fine * np.arange(np.ceil((-np.pi - start) / fine), np.floor((np.pi - start) / fine) + 1)
    switching = [angles.lash_closes, angles.seat_opens, angles.seat_closes, angles.lash_opens]
    borders = (about or cam.lift(np.zeros(cam.Z.shape[1]))).borders
    edges = np.sort(np.concatenate([uniform, switching, borders]))
    edges = edges[np.append(True, np.diff(edges) > 1e-10)]
    edges[0], edges[-1] = -np.pi, np.pi
    first = _first_edges(edges, borders, angles)
    low, high = edges[first], edges[np.append(first[1:], len(edges) - 1)]
    # a derivative that is discontinuous at a knot is taken from the piece on which the block lies
    piece, block = np.unique(np.searchsorted(borders, 0.5 * (low + high)) - 1, return_inverse=True)
    middle = 0.5 * (borders[piece] + borders[piece + 1])
    taylor = np.empty((len(middle), LIFT_DERIVATIVES, 1 + cam.Z.shape[1]))
    for order in range(LIFT_DERIVATIVES):
        matrix, offset = cam.basis(middle, order)
        taylor[:, order, 0] = offset + matrix @ cam.x_p if about is None else about(middle, order)
        taylor[:, order, 1:] = matrix @ cam.Z
    begin = np.zeros((len(first), LIFT_DERIVATIVES + 1, 1 + cam.Z.shape[1]))
    np.matmul(_shift(low - middle[block]), taylor[block], out=begin[:, :-1])
    begin[:, -1, 0] = 1.0
    return CamSamples(edges, first, begin)


def _shift(by: np.ndarray) -> np.ndarray:
    """Matrices (b, 7, 7) that shift a polynomial's value and derivatives by angles (b) [rad]."""
    order = np.arange(LIFT_DERIVATIVES)
    power = order - order[:, None]
    return np.where(power < 0, 0.0, by[:, None, None] ** np.maximum(power, 0)) / factorial(np.maximum(power, 0))


def _first_edges(edges: np.ndarray, borders: np.ndarray, angles: Angles) -> np.ndarray:
    """Indices of the edges at which blocks begin; with tangents, which may change at any edge, all but the last."""
    if angles.tangents is not None:
        return np.arange(len(edges) - 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    step_kinds = np.stack([angles.phase(middles), np.searchsorted(borders, middles), _rounded_widths(edges)])
    runs = np.flatnonzero(np.append(True, np.any(step_kinds[:, 1:] != step_kinds[:, :-1], axis=0)))
    ends = np.append(runs[1:], len(middles))
    return np.concatenate([np.arange(run, end, LONGEST) for run, end in zip(runs, ends, strict=True)])


def _rounded_widths(edges: np.ndarray) -> np.ndarray:
    """Widths of the steps [rad], rounded so that widths that are equal up to round-off become identical."""
    return np.round(np.diff(edges), 12)


@dataclass(frozen=True)
class PeriodicResponse:
    """Periodic motion at one speed, affine in z: every result is its column 0 plus its columns 1 to m times z.

    `begin` (b, s, 1 + m) are the states, as in `ExactSteps`, where the samples' blocks begin, and `powers`
    (p, kinds, s, s) advance them by 0, 1, ... steps. `map` (2n, 2n) advances a disturbance of positions [m] and
    velocities [m/s] by one revolution.
    """

    train: Train
    cam_speed: float
    samples: CamSamples
    kind: np.ndarray  # (b) kind of each block's steps
    begin: np.ndarray
    powers: np.ndarray
    map: np.ndarray
    tangents: Tangents | None = None

    @cached_property
    def spectral_radius(self) -> float:
        """Spectral radius of the map over one revolution; below one where the motion is stable."""
        return float(np.abs(np.linalg.eigvals(self.map)).max())

    @cached_property
    def state(self) -> np.ndarray:
        """Positions [m] and velocities [m/s] at the samples' edges, shape (k + 1, 2n, 1 + m)."""
        n, edges = len(self.train.mass), np.arange(len(self.samples.edges))
        scale = np.repeat([1.0, velocity_scale(self.train)], n)
        readings = scale[:, None] * np.eye(2 * n, self.begin.shape[1])
        return np.stack([self._read(reading, edges) for reading in readings], axis=1)

    def to_error(self, error: CamSamples) -> "PeriodicResponse":
        """The change of this motion by a cam's grinding error, whose samples have the same edges, blocks of which each
        lies within one of this motion's, and column 0 alone, without the constant one."""
        first, n2 = error.first, 2 * len(self.train.mass)
        kind = self.kind[np.searchsorted(self.samples.first, first, side="right") - 1]
        count = np.diff(np.append(first, len(error.edges) - 1))
        scale = np.repeat([1.0, velocity_scale(self.train)], n2 // 2)
        state, left = np.zeros(n2), np.eye(n2) - self.map / scale[:, None] * scale
        begin = np.zeros((len(first), n2 + LIFT_DERIVATIVES + 1))
        begin[:, n2:] = error.begin[..., 0]
        for start in (True, False):  # from a zero state, then from the periodic initial state
            for row, steps, of in zip(begin, count.tolist(), kind.tolist(), strict=True):
                row[:n2] = state
                state = self.powers[steps, of, :n2] @ row
            state = np.linalg.solve(left, state) if start else state
        return PeriodicResponse(self.train, self.cam_speed, error, kind, begin[..., None], self.powers, self.map)

    def force(self, element: int, at: np.ndarray) -> np.ndarray:
        """Force of an element [N] at ascending edges `at` (indices), as if it were closed, shape (len(at), 1 + m)."""
        t, n = self.train, len(self.train.mass)
        row, drive = t.incidence[element], float(t.cam_driven[element])
        k, load, c = t.stiffness[element], t.preload[element], t.damping[element]
        if self.tangents is not None:
            line = self.tangents.at(self.samples.edges[at])
            k, load = self.tangents.stiffness[line, element], self.tangents.load[line, element]
        reading = np.zeros((*np.shape(k), self.begin.shape[1]))
        reading[..., :n] = np.multiply.outer(k, row)
        reading[..., n : 2 * n] = c * velocity_scale(t) * row
        reading[..., 2 * n], reading[..., 2 * n + 1] = drive * k, drive * c * self.cam_speed
        reading[..., 2 * n + LIFT_DERIVATIVES] = load - k * t.gap[element]
        return self._read(reading, at)

    def gap(self, element: int, touch: float, at: np.ndarray) -> np.ndarray:
        """Separation of a contact [m], which touches at the compression `touch` [m], at ascending edges `at` (indices),
        shape (len(at), 1 + m). It is negative where the contact is compressed."""
        t, n, reading = self.train, len(self.train.mass), np.zeros(self.begin.shape[1])
        reading[:n], reading[2 * n] = -t.incidence[element], -float(t.cam_driven[element])
        reading[2 * n + LIFT_DERIVATIVES] = t.gap[element] + touch
        return self._read(reading, at)

    def _read(self, reading: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Values of the functional `reading` of the states, shape (s) or (len(at), s), at ascending edges `at`."""
        first = self.samples.first
        block = np.searchsorted(first, at, side="right") - 1
        block = np.minimum(block, len(first) - 1)
        steps, kind = at - first[block], self.kind[block]
        if reading.ndim == 1:
            rows = (reading @ self.powers)[steps, kind]
        else:
            rows = (reading[:, None] @ self.powers[steps, kind])[:, 0]
        if self.begin.shape[2] == 1:
            return np.einsum("as,asm->am", rows, self.begin[block])
        values = np.empty((len(at), self.begin.shape[2]))
        borders = np.flatnonzero(np.diff(block, prepend=-1, append=-1))
        for low, high in pairwise(borders):
            np.matmul(rows[low:high], self.begin[block[low]], out=values[low:high])
        return values


def periodic_response(train: Train, samples: CamSamples, cam_speed: float, angles: Angles) -> PeriodicResponse:
    """The periodic motion at `cam_speed` [rad/s] with the phases of `angles`, affine in the cam's free coefficients."""
    train = linearised_at_rest(train)
    steps, first = exact_steps(train, samples.edges, cam_speed, angles), samples.first
    count, kind = np.diff(np.append(first, len(steps.kind))), steps.kind[first]
    powers, n2 = steps.powers(int(count.max())), 2 * len(train.mass)
    columns, whole = samples.begin.shape[2], powers[count, kind]
    begin = np.zeros((len(first), powers.shape[-1], columns))
    lift = slice(n2, n2 + LIFT_DERIVATIVES + 1)
    begin[:, lift], begin[:, lift.stop :, 0] = samples.begin, steps.load[first]
    push = whole[:, :n2, lift] @ begin[:, lift]
    push[:, :, :1] += whole[:, :n2, lift.stop :] @ begin[:, lift.stop :, :1]
    carried = np.empty((len(first) + 1, n2, n2 + columns))  # homogeneous answers, then forced ones from zero
    carried[0] = np.eye(n2, n2 + columns)
    for j in range(len(first)):
        np.matmul(whole[j, :n2, :n2], carried[j], out=carried[j + 1])
        carried[j + 1, :, n2:] += push[j]
    start = np.linalg.solve(np.eye(n2) - carried[-1, :, :n2], carried[-1, :, n2:])
    begin[:, :n2] = carried[:-1, :, :n2] @ start + carried[:-1, :, n2:]
    scale = np.repeat([1.0, velocity_scale(train)], n2 // 2)
    monodromy = carried[-1, :, :n2] * scale[:, None] / scale
    return PeriodicResponse(train, cam_speed, samples, kind, begin, powers, monodromy, angles.tangents)


@lru_cache(maxsize=64)
def velocity_scale(train: Train) -> float:
    """A frequency [rad/s] by which velocities are divided to be as large as positions, for accurate exponentials."""
    d = train.incidence
    return float(np.sqrt(np.max(np.einsum("e,en,en->n", train.stiffness, d, d) / train.mass)))


def _generator(
    train: Train, scaled: tuple[np.ndarray, float], closed: np.ndarray, cam_speed: float, stiffness: np.ndarray | None
) -> np.ndarray:
    """d/dtheta of (x, v / omega, lift derivatives, 1) with the elements `closed` acting, shape (2 n + 8, 2 n + 8).

    `scaled` are the train's incidence and omega, its velocity scale. With the `stiffness` (e) of tangents, n further
    states follow: the constant forces on the masses [N], which then include the preloads and all other loads.
    """
    (incidence, omega), n, further = scaled, len(train.mass), stiffness is not None
    d = incidence[closed]
    k, c = (train.stiffness if stiffness is None else stiffness)[closed], train.damping[closed]
    drive = train.cam_driven[closed].astype(float)
    per_mass = 1.0 / train.mass[:, None]
    g = np.zeros((2 * n + LIFT_DERIVATIVES + 1 + n * further,) * 2)
    g[:n, n : 2 * n] = np.eye(n) * omega
    g[n : 2 * n, :n] = -per_mass * (d.T * k @ d) / omega
    g[n : 2 * n, n : 2 * n] = -per_mass * (d.T * c @ d + np.diag(train.mass_damping))
    g[n : 2 * n, 2 * n] = -d.T @ (k * drive) / train.mass / omega
    g[n : 2 * n, 2 * n + 1] = -cam_speed * d.T @ (c * drive) / train.mass / omega
    if further:
        g[n : 2 * n, -n:] = np.diag(1.0 / train.mass) / omega
    else:
        rest = train.mass_force - d.T @ (train.preload[closed] - k * train.gap[closed])
        g[n : 2 * n, -1] = rest / train.mass / omega
    g[: 2 * n] /= cam_speed
    chain = np.arange(2 * n, 2 * n + LIFT_DERIVATIVES - 1)
    g[chain, chain + 1] = 1.0
    return g


@dataclass(frozen=True)
class ExactSteps:
    """Exact steps of (x, v / velocity_scale, lift, lift', ..., 1): `whole[kind[j]]` leads from edge j to edge j + 1."""

    generator: np.ndarray  # (kinds, 2 n + 8, 2 n + 8) per rad
    whole: np.ndarray  # (kinds, 2 n + 8, 2 n + 8)
    kind: np.ndarray  # (k) int
    load: np.ndarray  # (k, n) N, constant forces on the masses in every step; (k, 0) without tangents

    def powers(self, most: int) -> np.ndarray:
        """Matrices of 0, 1, ... `most` steps of every kind, shape (most + 1, kinds, s, s)."""
        powers = np.empty((most + 1, *self.whole.shape))
        powers[0] = np.eye(self.whole.shape[-1])
        for j in range(most):
            np.matmul(self.whole, powers[j], out=powers[j + 1])
        return powers


def exact_steps(train: Train, edges: np.ndarray, cam_speed: float, angles: Angles) -> ExactSteps:
    """Steps between `edges` [rad] with the phases of `angles`; steps equal up to round-off share one exponential."""
    middles, contacts = 0.5 * (edges[1:] + edges[:-1]), phase_contacts(train)
    scaled = train.incidence, velocity_scale(train)
    phases, tangents = angles.phase(middles), angles.tangents
    kinds = np.column_stack([phases, _rounded_widths(edges)])
    load = np.zeros((len(middles), 0))
    if tangents is not None:
        line = tangents.at(middles)
        kinds = np.column_stack([kinds, tangents.stiffness[line]])
        pull = contacts[phases] * (tangents.load[line] - tangents.stiffness[line] * train.gap)
        load = train.mass_force + tangents.push[line] - pull @ scaled[0]
    kinds, kind = np.unique(kinds, axis=0, return_inverse=True)
    of = [(contacts[int(row[0])], row[2:] if tangents is not None else None) for row in kinds]
    generator = np.stack([_generator(train, scaled, closed, cam_speed, stiffness) for closed, stiffness in of])
    return ExactSteps(generator, expm(generator * kinds[:, 1, None, None]), kind, load)
