"""A periodic quintic smoothing spline whose noise and stiffness are estimated from the data (restricted likelihood).

The lift is sum_i c_i B_i on uniform knots over one turn, four times continuously differentiable, with a penalty on the
fourth or the third differences of c (P-splines: Eilers and Marx 1996, Statistical Science 11, Eq. 7). Interpreted as a
Gaussian prior, the penalty yields the noise, the weight of the penalty (Wahba 1985, Annals of Statistics 13, Eq. 1.8),
the standard error of every derivative (Silverman 1985, JRSS B 47, section 6), and which of the two differences the rows
support: fourth ones correspond to a jerk that wanders and steps, third ones to an acceleration that does. Coefficients
outside the event are zero, so that the base circle is exactly zero, and no coefficient is negative, so that the lift is
not. Angles are in degrees and lifts in mm.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import fminbound
from scipy.sparse import csr_array
from scipy.special import comb, gammaln

from camopt.cam.tables.interpolation import with_one_base_circle

DEGREE = 5
BAND = 2 * DEGREE + 1
"""Diagonals of the equations from the main one down: at most twice the distance of two coefficients on the ring."""
PENALTY_ORDERS = (4, 3)
"""Orders of the differences that are compared. On the tables of experiments/measured_tables.py third differences alone
have 1.1 to 2 times the error of fourth ones on cams of limited jerk; fourth ones alone have up to 1.4 times that of
third ones where the acceleration steps, and state half of it or less. Generalised cross-validation takes the coarse
tables (1 and 2 deg) for noise-free."""
RULED_OUT = 13.8
"""Twice the logarithm of the odds, 1000 to 1, from which the rows rule out an order."""
ADDED_PRECISION = 100.0
"""Precision of added rows over that of measured ones; the spline follows them to a tenth of the noise."""
WEIGHTS = np.arange(-18.0, 16.0, 3.0)
"""Logarithms of the penalty's weight that are tried before the best is refined. Below them, the equations are singular
to rounding if the knots are denser than the rows."""
_CARDINAL = BSpline.basis_element(np.arange(DEGREE + 2.0), extrapolate=False)


def basis(degrees: np.ndarray, count: int, order: int = 0) -> csr_array:
    """Values (r, count) of the periodic basis functions, or of a derivative, at `degrees` (r). Function i lies on the
    knots i-5 to i+1, which are at 360 i/count."""
    h = 360.0 / count
    piece = np.floor(degrees / h).astype(int)
    local = (degrees / h - piece)[:, None] + DEGREE - np.arange(DEGREE + 1)
    shape = _CARDINAL.derivative(order) if order else _CARDINAL
    values = np.nan_to_num(shape(local)) / h**order
    columns = np.mod(piece[:, None] + np.arange(DEGREE + 1), count)
    rows = np.repeat(np.arange(len(degrees)), DEGREE + 1)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(len(degrees), count))


class Equations:
    """Normal equations of the measured and the added rows, and the restricted likelihood of a penalty."""

    def __init__(self, degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray, added: int):
        self.count, self.free, self.measured = count, free, len(lift) - added
        self.rows = basis(degrees, count)[:, free]
        self.lift = lift
        self.precision = np.where(np.arange(len(lift)) < self.measured, 1.0, ADDED_PRECISION)
        weighted = self.rows.multiply(self.precision[:, None]).tocsr()
        self.normal, self.right = _bands(weighted.T @ self.rows), weighted.T @ lift
        self.penalties = {order: _bands(_penalty(count, order)[free][:, free]) for order in PENALTY_ORDERS}

    def solved(self, order: int, log_weight: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Banded factor, coefficients (k), and variance of a measured row [mm^2]."""
        factor = cholesky_banded(self.normal + np.exp(log_weight) * self.penalties[order], lower=True)
        c = cho_solve_banded((factor, True), self.right)
        turn = np.zeros(self.count)
        turn[self.free] = c
        for _ in range(order):
            turn = np.roll(turn, -1) - turn
        bent = np.exp(log_weight) * _scale(self.count, order) * float(turn @ turn)
        missed = float(np.sum(self.precision * (self.lift - self.rows @ c) ** 2))
        return factor, c, (missed + bent) / self.measured

    def cost(self, order: int, log_weight: float) -> float:
        """Minus twice the logarithm of the restricted likelihood, without terms that are the same for all penalties."""
        factor, _, variance = self.solved(order, log_weight)
        size = len(self.free)
        rank = size - (size == self.count)  # a constant over the whole turn is not penalised
        scaled = rank * (log_weight + np.log(_scale(self.count, order)))
        return (
            self.measured * np.log(variance)
            + 2 * np.log(factor[0]).sum()
            - scaled
            - _log_determinant(size, order, size == self.count)
        )

    def likeliest(self, order: int) -> tuple[int, float]:
        """The order, and the logarithm of the weight that has the largest restricted likelihood for it."""
        best = WEIGHTS[int(np.argmin([self.cost(order, weight) for weight in WEIGHTS]))]
        refined = fminbound(lambda weight: self.cost(order, float(weight)), best - 3, best + 3, xtol=0.05)
        return order, float(np.asarray(refined))


@dataclass(frozen=True)
class Fit:
    """A spline through noisy rows: `coefficients` (n) [mm] on n knots; those outside the `equations` are zero."""

    equations: Equations = field(repr=False)
    coefficients: np.ndarray = field(repr=False)
    penalty: tuple[int, float]  # order of the differences that are penalised, logarithm of the penalty's weight
    noise: float  # standard deviation of a row [mm]
    residuals: np.ndarray  # (r) row less spline [mm]
    leverage: np.ndarray  # (r) share of a row's own error that the spline follows, 0 to 1

    def studentised(self) -> np.ndarray:
        """Residuals over their own standard deviation, shape (r)."""
        return self.residuals / (self.noise * np.sqrt(np.maximum(1.0 - self.leverage, 1e-12)))

    def pieces(self) -> PPoly:
        """The spline over one turn from 0, angle [deg] and lift [mm], with the base circle as one piece."""
        count = len(self.coefficients)
        knots = np.arange(-DEGREE, count + DEGREE + 1) * (360.0 / count)
        all_pieces = PPoly.from_spline(BSpline(knots, np.append(self.coefficients, self.coefficients[:DEGREE]), DEGREE))
        c = all_pieces.c[:, DEGREE : DEGREE + count]
        return with_one_base_circle(PPoly(c, np.append(knots[DEGREE : DEGREE + count], 360.0)))

    def acceleration_error(self) -> tuple[float, float, float]:
        """Standard errors of the acceleration over its largest magnitude: the root mean square over the event under the
        penalty that the rows support best; the largest such value under the penalties that the rows do not rule out;
        and, likewise, the larger of the errors at the largest and at the smallest acceleration."""
        equations, count = self.equations, len(self.coefficients)
        first = equations.free.min() if len(equations.free) == count else equations.free[0]
        at = (first - DEGREE + np.arange(0, len(equations.free) + DEGREE, 0.25)) * (360.0 / count)
        rows = basis(np.mod(at, 360.0), count, 2)[:, equations.free]
        acceleration = rows @ self.coefficients[equations.free]
        peaks = [int(np.argmax(acceleration)), int(np.argmin(acceleration))]
        errors = []
        for order in PENALTY_ORDERS:
            penalty = equations.likeliest(order)
            factor, _, variance = equations.solved(*penalty)
            error = variance * _quadratic_forms(rows, cho_solve_banded((factor, True), np.eye(len(equations.free))))
            rms, at_peak = np.sqrt(error.mean()), np.sqrt(error[peaks].max())
            errors.append((equations.cost(*penalty), float(rms), float(at_peak)))
        best = min(errors)
        allowed = [entry for entry in errors if entry[0] - best[0] < RULED_OUT]
        rms, at_peak = (max(entry[i] for entry in allowed) for i in (1, 2))
        largest = float(np.abs(acceleration).max())
        return best[1] / largest, rms / largest, at_peak / largest


def fitted(
    degrees: np.ndarray,
    lift: np.ndarray,
    count: int,
    free: np.ndarray,
    added: int = 0,
    penalty: tuple[int, float] | None = None,
) -> Fit:
    """The spline through rows `degrees`, `lift` [mm] (r), with coefficients `free` (k) in cyclic order, others zero.

    Without a `penalty` (order, logarithm of weight) the one of largest restricted likelihood is taken. The last `added`
    rows are not measured.
    """
    if len(free) == count:  # full turn: taken alternately from both ends, neighbours on the ring stay close
        free = np.stack([free, free[::-1]], axis=1).ravel()[:count]
    equations = Equations(degrees, lift, count, free, added)
    if penalty is None:
        penalty = min((equations.likeliest(order) for order in PENALTY_ORDERS), key=lambda p: equations.cost(*p))
    factor, c, variance = equations.solved(*penalty)
    covariance = cho_solve_banded((factor, True), np.eye(len(free)))
    coefficients = np.zeros(count)
    coefficients[free] = c
    rows = equations.rows[: len(lift) - added]
    residuals = lift[: len(lift) - added] - rows @ c
    leverage = _quadratic_forms(rows, covariance)
    return Fit(equations, coefficients, penalty, float(np.sqrt(variance)), residuals, leverage)


def fitted_non_negative(degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray, added: int = 0) -> Fit:
    """As `fitted`, with the ends of the event moved inwards until no coefficient is negative, or none is positive (a
    table that is no lift). The feet then lie where the lift exceeds the noise."""
    fit = fitted(degrees, lift, count, free, added)
    while True:
        c = fit.coefficients[free]
        negative, top = np.flatnonzero(c < 0), int(np.argmax(c))
        if len(negative) == 0 or c[top] <= 0:
            return fit
        first = int(negative[negative < top].max(initial=-1)) + 1
        last = int(negative[negative > top].min(initial=len(c)))
        free = free[first:last]  # shorter by one coefficient at least
        fit = fitted(degrees, lift, count, free, added, fit.penalty)


def _penalty(count: int, order: int) -> csr_array:
    """Integral of the squared derivative of an order, from differences at uniform knots, cyclic, (count, count)."""
    weights = [(-1) ** d * comb(2 * order, order + d, exact=True) for d in range(-order, order + 1)]
    columns = np.mod(np.arange(count)[:, None] + np.arange(-order, order + 1), count)
    rows = np.repeat(np.arange(count), 2 * order + 1)
    values = np.tile(weights, count) * _scale(count, order)
    return csr_array((values, (rows, columns.ravel())), shape=(count, count))


def _scale(count: int, order: int) -> float:
    """Integral over the angle [deg] of the squared derivative of an order, over the sum of its squared differences."""
    return (count / 360.0) ** (2 * order - 1)


def _log_determinant(size: int, order: int, ring: bool) -> float:
    """Logarithm of the determinant of the squared differences of `size` coefficients, zero beyond both ends.

    It is a Toeplitz matrix of symbol (2 - 2 cos x)^order, a pure Fisher-Hartwig singularity (Boettcher and Silbermann
    1999, Introduction to Large Truncated Toeplitz Matrices). On the `ring` it is the product of the nonzero
    eigenvalues, size^(2 order).
    """
    if ring:
        return 2 * order * float(np.log(size))
    k = np.arange(1, size + 1)
    return float(np.sum(gammaln(k) + gammaln(2 * order + k) - 2 * gammaln(order + k)))


def _bands(matrix) -> np.ndarray:
    """Diagonals of a symmetric matrix from the main one down, shape (BAND, k), as LAPACK stores them."""
    size = matrix.shape[0]
    return np.array([np.pad(matrix.diagonal(-k), (0, min(k, size))) for k in range(BAND)])


def _quadratic_forms(rows: csr_array, matrix: np.ndarray) -> np.ndarray:
    """The diagonal of rows @ matrix @ rows.T."""
    return np.asarray(rows.multiply(rows @ matrix).sum(axis=1)).ravel()
