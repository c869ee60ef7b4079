"""A periodic quintic smoothing spline whose noise and stiffness come from the data (restricted likelihood).

The lift is sum_i c_i B_i on uniform knots over one turn, four times continuously differentiable, and penalised by the
fourth or the third differences of c (P-splines: Eilers and Marx 1996, Statistical Science 11, Eq. 7). Read as a
Gaussian prior, the penalty gives the noise, the weight of the penalty (Wahba 1985, Annals of Statistics 13, Eq. 1.8),
the standard error of every derivative (Silverman 1985, JRSS B 47, section 6), and which of the two differences the rows
speak for: fourth ones expect a jerk that wanders and steps, third ones an acceleration that does. Coefficients outside
the event are zero, so that the base circle is exactly zero, and no coefficient is negative, so that the lift is not.
Degrees and mm inside.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import fminbound
from scipy.sparse import csr_array
from scipy.special import comb, gammaln

DEGREE = 5
BAND = 2 * DEGREE + 1
"""Diagonals of the equations from the main one down: two knots on the ring are at most twice as far apart in them."""
PENALTY_ORDERS = (4, 3)
"""On the tables of experiments/measured_tables.py third differences alone leave 1.1 to 2 times the error of fourth ones
on cams of limited jerk; fourth ones alone leave up to 1.4 times that of third ones where the acceleration steps, and
state half of it or less. Generalised cross validation takes the coarse tables (1 and 2 deg) for noise-free."""
RULED_OUT = 13.8
"""Twice the logarithm of the odds, 1000 to 1, at which the rows have ruled out an order."""
GIVEN_PRECISION = 100.0
"""Precision of rows that are given, not measured, over that of a measured one: they hold to a tenth of the noise."""
WEIGHTS = np.arange(-18.0, 16.0, 3.0)
"""Logarithms of the penalty's weight that are tried before the best is refined. Below, the equations of knots denser
than rows are singular to rounding."""
_CARDINAL = BSpline.basis_element(np.arange(DEGREE + 2.0), extrapolate=False)


def basis(degrees: np.ndarray, count: int, order: int = 0) -> csr_array:
    """Values (r, count) of the periodic basis functions, of which i stands on the knots i-5 to i+1, at 360 i/count, or
    of a derivative, at `degrees` (r)."""
    h = 360.0 / count
    piece = np.floor(degrees / h).astype(int)
    local = (degrees / h - piece)[:, None] + DEGREE - np.arange(DEGREE + 1)
    shape = _CARDINAL.derivative(order) if order else _CARDINAL
    values = np.nan_to_num(shape(local)) / h**order
    columns = np.mod(piece[:, None] + np.arange(DEGREE + 1), count)
    rows = np.repeat(np.arange(len(degrees)), DEGREE + 1)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(len(degrees), count))


class Equations:
    """Normal equations of the measured and the given rows, and the restricted likelihood of a penalty."""

    def __init__(self, degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray, given: int):
        self.count, self.free, self.measured = count, free, len(lift) - given
        self.rows = basis(degrees, count)[:, free]
        self.lift = lift
        self.precision = np.where(np.arange(len(lift)) < self.measured, 1.0, GIVEN_PRECISION)
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
        """Minus twice the logarithm of the restricted likelihood, less what no penalty changes."""
        factor, _, variance = self.solved(order, log_weight)
        size = len(self.free)
        rank = size - (size == self.count)  # a constant over the whole turn costs nothing
        scaled = rank * (log_weight + np.log(_scale(self.count, order)))
        return (
            self.measured * np.log(variance)
            + 2 * np.log(factor[0]).sum()
            - scaled
            - _log_determinant(size, order, size == self.count)
        )

    def likeliest(self, order: int) -> tuple[int, float]:
        """The order, and the logarithm of its weight of largest restricted likelihood."""
        best = WEIGHTS[int(np.argmin([self.cost(order, weight) for weight in WEIGHTS]))]
        found = fminbound(lambda weight: self.cost(order, float(weight)), best - 3, best + 3, xtol=0.05)
        return order, float(np.asarray(found))


@dataclass(frozen=True)
class Fit:
    """A spline through noisy rows: `coefficients` (n) [mm] on n knots, those that the `equations` do not have zero."""

    equations: Equations = field(repr=False)
    coefficients: np.ndarray = field(repr=False)
    penalty: tuple[int, float]  # order of the differences that are penalised, logarithm of the penalty's weight
    noise: float  # standard deviation of a row [mm]
    residuals: np.ndarray  # (r) row less spline [mm]
    leverage: np.ndarray  # (r) how far the spline follows a row's own error, 0 to 1

    def studentised(self) -> np.ndarray:
        """Residuals over their own standard deviation, shape (r)."""
        return self.residuals / (self.noise * np.sqrt(np.maximum(1.0 - self.leverage, 1e-12)))

    def pieces(self) -> PPoly:
        """The spline over one turn from 0, angle [deg] and lift [mm], pieces on the base circle joined."""
        count = len(self.coefficients)
        knots = np.arange(-DEGREE, count + DEGREE + 1) * (360.0 / count)
        all_pieces = PPoly.from_spline(BSpline(knots, np.append(self.coefficients, self.coefficients[:DEGREE]), DEGREE))
        c = all_pieces.c[:, DEGREE : DEGREE + count]
        zero = ~np.any(c, axis=0)
        kept = ~(zero & np.append(False, zero[:-1]))
        return PPoly(c[:, kept], np.append(knots[DEGREE : DEGREE + count][kept], 360.0))

    def acceleration_error(self) -> tuple[float, float, float]:
        """Standard errors of the acceleration over its largest size: the root mean square over the event under the
        penalty that the rows speak for; the largest such one under the penalties that the rows do not rule out; and,
        likewise, the larger of the errors where the acceleration is largest and smallest."""
        equations, count = self.equations, len(self.coefficients)
        first = equations.free.min() if len(equations.free) == count else equations.free[0]
        at = (first - DEGREE + np.arange(0, len(equations.free) + DEGREE, 0.25)) * (360.0 / count)
        rows = basis(np.mod(at, 360.0), count, 2)[:, equations.free]
        acceleration = rows @ self.coefficients[equations.free]
        peaks = [int(np.argmax(acceleration)), int(np.argmin(acceleration))]
        found = []
        for order in PENALTY_ORDERS:
            penalty = equations.likeliest(order)
            factor, _, variance = equations.solved(*penalty)
            error = variance * _quadratic_forms(rows, cho_solve_banded((factor, True), np.eye(len(equations.free))))
            found.append((equations.cost(*penalty), float(np.sqrt(error.mean())), float(np.sqrt(error[peaks].max()))))
        best = min(found)
        allowed = [one for one in found if one[0] - best[0] < RULED_OUT]
        rms, at_peak = (max(one[i] for one in allowed) for i in (1, 2))
        largest = float(np.abs(acceleration).max())
        return best[1] / largest, rms / largest, at_peak / largest


def fitted(
    degrees: np.ndarray,
    lift: np.ndarray,
    count: int,
    free: np.ndarray,
    given: int = 0,
    penalty: tuple[int, float] | None = None,
) -> Fit:
    """The spline through rows `degrees`, `lift` [mm] (r), its coefficients `free` (k) in cyclic order, others zero.

    Without a `penalty` (order, logarithm of the weight) the one of largest restricted likelihood is taken. The last
    `given` rows are not measured.
    """
    if len(free) == count:  # cyclic: neighbours on the ring come near each other by going both ways round at once
        free = np.stack([free, free[::-1]], axis=1).ravel()[:count]
    equations = Equations(degrees, lift, count, free, given)
    if penalty is None:
        penalty = min((equations.likeliest(order) for order in PENALTY_ORDERS), key=lambda p: equations.cost(*p))
    factor, c, variance = equations.solved(*penalty)
    covariance = cho_solve_banded((factor, True), np.eye(len(free)))
    coefficients = np.zeros(count)
    coefficients[free] = c
    rows = equations.rows[: len(lift) - given]
    residuals = lift[: len(lift) - given] - rows @ c
    leverage = _quadratic_forms(rows, covariance)
    return Fit(equations, coefficients, penalty, float(np.sqrt(variance)), residuals, leverage)


def fitted_non_negative(degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray, given: int = 0) -> Fit:
    """As `fitted`, its ends drawn in until no coefficient is negative, or none is positive (a table that is no lift):
    the feet lie where the lift leaves the noise."""
    fit = fitted(degrees, lift, count, free, given)
    while True:
        c = fit.coefficients[free]
        negative, top = np.flatnonzero(c < 0), int(np.argmax(c))
        if len(negative) == 0 or c[top] <= 0:
            return fit
        first = int(negative[negative < top].max(initial=-1)) + 1
        last = int(negative[negative > top].min(initial=len(c)))
        free = free[first:last]  # shorter by one coefficient at least
        fit = fitted(degrees, lift, count, free, given, fit.penalty)


def _penalty(count: int, order: int) -> csr_array:
    """Integral of the squared derivative of an order by its differences at uniform knots, cyclic, (count, count)."""
    weights = [(-1) ** d * comb(2 * order, order + d, exact=True) for d in range(-order, order + 1)]
    columns = np.mod(np.arange(count)[:, None] + np.arange(-order, order + 1), count)
    rows = np.repeat(np.arange(count), 2 * order + 1)
    values = np.tile(weights, count) * _scale(count, order)
    return csr_array((values, (rows, columns.ravel())), shape=(count, count))


def _scale(count: int, order: int) -> float:
    """Integral over the angle [deg] of a squared derivative of an order, over its sum of squared differences."""
    return (count / 360.0) ** (2 * order - 1)


def _log_determinant(size: int, order: int, ring: bool) -> float:
    """Logarithm of the determinant of the squared differences of `size` coefficients, zero beyond both ends.

    It is a Toeplitz matrix of symbol (2 - 2 cos x)^order, a pure Fisher-Hartwig singularity (Boettcher and Silbermann
    1999, Introduction to Large Truncated Toeplitz Matrices); on the `ring` the product of its eigenvalues but for the
    zero counts, size^(2 order).
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
