"""Periodic motion of a train whose contacts switch at given cam angles: linear in the cam, one solve per speed.

There are three phases: seated, shared (seat and cam side both loaded) and lifted. Within a phase the same contacts stay
closed and may even pull. The motion is therefore linear with constant matrices, and its steady periodic response is
affine in the cam's free coefficients. Each step is exact: the lift is a polynomial on it, so that the lift's
derivatives are carried as further states and one matrix exponential moves both (Van Loan, IEEE Trans. Automatic
Control 23, 1978). Where laws are not linear, straight lines along a motion stand for them (see `tangents`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PPoly
from scipy.linalg import expm

from camopt.cam.families.free import FreeCam
from camopt.cam.ramps import Ramp
from camopt.optimizer.program.tangents import Tangents
from camopt.scene.errors import InputError
from camopt.scene.rest import rest_position, static_matrices
from camopt.scene.standing_in import standing_in
from camopt.scene.train import GROUND, Train
from camopt.scene.units import DEG, MM

SEATED, SHARED, LIFTED = range(3)
LIFT_DERIVATIVES = 7
"""Number of derivatives that a step carries, the lift included: the ramps' feet are polynomials of degree six."""
SAMPLE = 0.25 * DEG
"""Longest step between samples of the motion."""


@dataclass(frozen=True)
class Angles:
    """Cam angles [rad] at which the phases change: the lash closes, the seat opens, the seat closes, the lash opens.

    Where laws are not linear, `tangents` stand for them; without any, their tangents at rest do.
    """

    lash_closes: float
    seat_opens: float
    seat_closes: float
    lash_opens: float
    tangents: Tangents | None = None

    def __post_init__(self):
        order = (-np.pi, self.lash_closes, self.seat_opens, self.seat_closes, self.lash_opens, np.pi)
        if not (np.all(np.diff(order) >= 0) and self.seat_opens < self.seat_closes):
            raise ValueError(f"switching angles must ascend within a revolution (given: {self})")

    def phase(self, theta: np.ndarray) -> np.ndarray:
        """Phase at angles theta [rad]."""
        shared = (theta > self.lash_closes) & (theta < self.lash_opens)
        lifted = (theta > self.seat_opens) & (theta < self.seat_closes)
        return np.where(lifted, LIFTED, np.where(shared, SHARED, SEATED))


def phase_contacts(train: Train) -> np.ndarray:
    """Elements that act in each phase, shape (3, e) bool: seated, shared, lifted.

    In the seated phase the set closed at rest acts. Raises InputError where more than one contact between cam and valve
    is open at rest.
    """
    train = standing_in(train)
    x = rest_position(train)
    margin = train.compression(x, 0.0) - train.touch_compression
    seated = ~train.contact | (margin >= -1e-12)  # a contact at its touch, to round-off, counts as closed
    opened = [train.element_names[e] for e in train.cam_side if not seated[e]]
    if len(opened) > 1:
        raise InputError(f"the no-jump program needs the lash at one contact; open at rest: {', '.join(opened)}")
    shared = seated.copy()
    shared[list(train.cam_side)] = True
    lifted = shared.copy()
    lifted[train.seat] = False
    return np.stack([seated, shared, lifted])


def static_angles(train: Train, cam: FreeCam) -> Angles:
    """Switching angles by the quasi-static load transfer on the ramps; raises InputError where a ramp is too low."""
    train = standing_in(train)
    seated, shared, _ = phase_contacts(train)
    opening = _lift_at_touch(train, shared, train.seat)
    lash = [e for e in train.cam_side if not seated[e]]
    closing = _lift_at_touch(train, seated, lash[0]) if lash else opening
    half = float(cam.breaks[-1])
    before = [_before_top(cam.opening, lift, "opening") for lift in (closing, opening)]
    after = [_before_top(cam.closing, lift, "closing") for lift in (opening, closing)]
    return Angles(-half - before[0], -half - before[1], half + after[0], half + after[1])


def _lift_at_touch(train: Train, closed: np.ndarray, element: int) -> float:
    """Lift [m] at which `element` touches without force in static equilibrium with the elements `closed`."""
    stiffness, load = static_matrices(train, closed)
    driven = incidence(train).T @ (train.stiffness * train.cam_driven * closed)
    scale = 1.0 / np.sqrt(np.diag(stiffness))
    x = scale[:, None] * np.linalg.solve(
        stiffness * scale * scale[:, None], scale[:, None] * np.column_stack([load, -driven])
    )
    row = incidence(train)[element]
    rate = row @ x[:, 1] + train.cam_driven[element]
    touch = train.touch_compression[element]
    return float((touch + train.gap[element] - row @ x[:, 0]) / rate)


def _before_top(ramp: Ramp, lift: float, side: str) -> float:
    """Angle [rad] before the ramp top at which the ramp has reached `lift` [m]."""
    if not 0 < lift < ramp.height:
        raise InputError(
            f"the {side} ramp of {ramp.height / MM:g} mm is too low: the load moves from seat to cam at "
            f"{lift / MM:.4g} mm of lift, which must lie on the ramp"
        )
    borders, pieces = ramp.opening_pieces(0.0)
    keep = np.append(True, np.diff(borders) > 0)  # a ramp without foot
    roots = PPoly(pieces[keep[1:], ::-1].T, borders[keep]).solve(lift, extrapolate=False)
    return -float(roots[np.isfinite(roots)][0])


def incidence(train: Train) -> np.ndarray:
    """Matrix D (e, n) with compression d = D x + cam_driven * lift - gap."""
    matrix = np.zeros((len(train.a), len(train.mass)))
    for e in range(len(train.a)):
        if train.a[e] != GROUND:
            matrix[e, train.a[e]] += 1.0
        if train.b[e] != GROUND:
            matrix[e, train.b[e]] -= 1.0
    return matrix


@dataclass(frozen=True)
class CamSamples:
    """What every speed needs of the cam: step edges (k + 1) [rad] from -pi to pi, lift derivatives at step middles.

    `middle` (k, 8, 1 + m) holds the lift, six derivatives by angle and the constant one, for the cam at z = 0 (column
    0) and for every free coefficient. `edge` (k + 1, 2, 1 + m) holds lift and velocity at the edges.
    """

    edges: np.ndarray
    middle: np.ndarray
    edge: np.ndarray


def sample_cam(cam: FreeCam, angles: Angles, step: float = SAMPLE) -> CamSamples:
    """Steps of at most `step` [rad] whose edges include every knot, ramp border and switching angle."""
    knot = cam.breaks[1] - cam.breaks[0]
    fine = knot / np.ceil(knot / step - 1e-9)
    start = cam.breaks[0]
    uniform = start + fine * np.arange(np.ceil((-np.pi - start) / fine), np.floor((np.pi - start) / fine) + 1)
    switching = [angles.lash_closes, angles.seat_opens, angles.seat_closes, angles.lash_opens]
    borders = cam.lift(np.zeros(cam.Z.shape[1])).borders
    edges = np.sort(np.concatenate([uniform, switching, borders]))
    edges = edges[np.append(True, np.diff(edges) > 1e-10)]
    edges[0], edges[-1] = -np.pi, np.pi
    middles = 0.5 * (edges[1:] + edges[:-1])
    middle = np.zeros((len(middles), LIFT_DERIVATIVES + 1, 1 + cam.Z.shape[1]))
    for order in range(LIFT_DERIVATIVES):
        middle[:, order] = _affine(cam, middles, order)
    middle[:, -1, 0] = 1.0
    return CamSamples(edges, middle, np.stack([_affine(cam, edges, order) for order in (0, 1)], axis=1))


def _affine(cam: FreeCam, theta: np.ndarray, order: int) -> np.ndarray:
    """Lift derivative at z = 0 (column 0) and per free coefficient, shape (k, 1 + m)."""
    matrix, offset = cam.basis(theta, order)
    return np.column_stack([offset + matrix @ cam.x_p, matrix @ cam.Z])


@dataclass(frozen=True)
class PeriodicResponse:
    """Steady motion at one speed: the state (x, v) at the samples' edges is state[..., 0] + state[..., 1:] @ z.

    `state` has the shape (k + 1, 2n, 1 + m) and the units m and m/s; `map` (2n, 2n) carries a disturbance over one
    revolution.
    """

    train: Train
    cam_speed: float
    samples: CamSamples
    state: np.ndarray
    map: np.ndarray
    tangents: Tangents | None = None

    @cached_property
    def spectral_radius(self) -> float:
        """Factor by which disturbances shrink in one revolution; below one where the motion is stable."""
        return float(np.abs(np.linalg.eigvals(self.map)).max())

    def force(self, element: int, at: np.ndarray) -> np.ndarray:
        """Force of an element [N] at edges `at` (indices), as if it were closed: (len(at), 1 + m), affine in z."""
        t, n = self.train, len(self.train.mass)
        row = incidence(t)[element]
        k, load, c = t.stiffness[element], t.preload[element], t.damping[element]
        if self.tangents is not None:
            line = self.tangents.at(self.samples.edges[at])
            k, load = self.tangents.stiffness[line, element, None], self.tangents.load[line, element]
        state = self.state[at].reshape(len(at), 2 * n, -1)
        force = k * (row @ state[:, :n]) + c * (row @ state[:, n:])
        drive = float(t.cam_driven[element])
        force += drive * (k * self.samples.edge[at, 0] + c * self.cam_speed * self.samples.edge[at, 1])
        force[:, 0] += load - np.ravel(k) * t.gap[element]
        return force


def periodic_response(train: Train, samples: CamSamples, cam_speed: float, angles: Angles) -> PeriodicResponse:
    """The periodic motion at `cam_speed` [rad/s] with the phases of `angles`, affine in the cam's free coefficients."""
    train = standing_in(train)
    steps = exact_steps(train, samples.edges, cam_speed, angles)
    n2, k, kind = 2 * len(train.mass), len(steps.kind), steps.kind
    moves, pushes = steps.whole[:, :n2, :n2], steps.from_middle(n2)
    push = np.empty((k, n2, samples.middle.shape[2]))
    for i in range(len(moves)):
        push[kind == i] = pushes[i][:, : LIFT_DERIVATIVES + 1] @ samples.middle[kind == i]
        if angles.tangents is not None:
            push[kind == i, :, 0] += steps.load[kind == i] @ pushes[i][:, LIFT_DERIVATIVES + 1 :].T
    carried = np.empty((k + 1, n2, n2 + push.shape[2]))  # homogeneous answers, then forced ones from zero
    carried[0] = np.eye(n2, carried.shape[2])
    for j in range(k):
        np.matmul(moves[kind[j]], carried[j], out=carried[j + 1])
        carried[j + 1, :, n2:] += push[j]
    start = np.linalg.solve(np.eye(n2) - carried[-1, :, :n2], carried[-1, :, n2:])
    state = carried[:, :, :n2] @ start + carried[:, :, n2:]
    omega = velocity_scale(train)
    state[:, n2 // 2 :] *= omega
    scale = np.repeat([1.0, omega], n2 // 2)
    return PeriodicResponse(
        train, cam_speed, samples, state, carried[-1, :, :n2] * scale[:, None] / scale, angles.tangents
    )


def velocity_scale(train: Train) -> float:
    """A frequency [rad/s] by which velocities are divided to be as large as positions, so that exponentials keep their
    accuracy."""
    d = incidence(train)
    return float(np.sqrt(np.max(np.einsum("e,en,en->n", train.stiffness, d, d) / train.mass)))


def _generator(train: Train, closed: np.ndarray, cam_speed: float, stiffness: np.ndarray | None = None) -> np.ndarray:
    """d/dtheta of (x, v / omega, lift derivatives, 1) with the elements `closed` acting, shape (2 n + 8, 2 n + 8).

    With the `stiffness` (e) of tangents n further states follow: constant forces on the masses [N], all there are.
    """
    n, omega, further = len(train.mass), velocity_scale(train), stiffness is not None
    d = incidence(train)[closed]
    k, c = (train.stiffness if stiffness is None else stiffness)[closed], train.damping[closed]
    drive = train.cam_driven[closed].astype(float)
    per_mass = 1.0 / train.mass[:, None]
    g = np.zeros((2 * n + LIFT_DERIVATIVES + 1 + n * further,) * 2)
    g[:n, n : 2 * n] = np.eye(n) * omega
    g[n : 2 * n, :n] = -per_mass * (d.T * k @ d) / omega
    g[n : 2 * n, n : 2 * n] = -per_mass * (d.T * c @ d + np.diag(train.mass_damping))
    push = [-d.T @ (k * drive), -cam_speed * d.T @ (c * drive)]
    rest = train.mass_force - d.T @ (train.preload[closed] - k * train.gap[closed])
    for column, force in zip((2 * n, 2 * n + 1), push, strict=True):
        g[n : 2 * n, column] = force / train.mass / omega
    if further:
        g[n : 2 * n, -n:] = np.diag(1.0 / train.mass) / omega
    else:
        g[n : 2 * n, -1] = rest / train.mass / omega
    g[: 2 * n] /= cam_speed
    chain = np.arange(2 * n, 2 * n + LIFT_DERIVATIVES - 1)
    g[chain, chain + 1] = 1.0
    return g


@dataclass(frozen=True)
class ExactSteps:
    """Exact steps of (x, v / velocity_scale, lift, lift', ..., 1): `whole[kind[j]]` moves edge j to edge j + 1."""

    generator: np.ndarray  # (kinds, 2 n + 8, 2 n + 8) per rad
    width: np.ndarray  # (kinds) rad
    whole: np.ndarray  # (kinds, 2 n + 8, 2 n + 8)
    kind: np.ndarray  # (k) int
    load: np.ndarray  # (k, n) N, constant forces on the masses in every step; of tangents alone

    def from_middle(self, n2: int) -> np.ndarray:
        """What the lift derivatives at a step's middle add to the state (n2) at its end, for every kind of step."""
        back = expm(-0.5 * self.generator[:, n2:, n2:] * self.width[:, None, None])
        return self.whole[:, :n2, n2:] @ back


def exact_steps(train: Train, edges: np.ndarray, cam_speed: float, angles: Angles) -> ExactSteps:
    """Steps between `edges` [rad] with the phases of `angles`; steps equal to round-off share one exponential."""
    middles, contacts = 0.5 * (edges[1:] + edges[:-1]), phase_contacts(train)
    phases, tangents = angles.phase(middles), angles.tangents
    kinds = np.column_stack([phases, np.round(np.diff(edges), 12)])
    load = np.zeros((len(middles), 0))
    if tangents is not None:
        line = tangents.at(middles)
        kinds = np.column_stack([kinds, tangents.stiffness[line]])
        pull = contacts[phases] * (tangents.load[line] - tangents.stiffness[line] * train.gap)
        load = train.mass_force + tangents.push[line] - pull @ incidence(train)
    kinds, kind = np.unique(kinds, axis=0, return_inverse=True)
    of = [(contacts[int(row[0])], row[2:] if tangents is not None else None) for row in kinds]
    generator = np.stack([_generator(train, closed, cam_speed, stiffness) for closed, stiffness in of])
    width = kinds[:, 1]
    return ExactSteps(generator, width, expm(generator * width[:, None, None]), kind, load)
