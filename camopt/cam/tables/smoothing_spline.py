"""A periodic quintic smoothing spline whose noise and stiffness come from the data (restricted likelihood).

The lift is sum_i c_i B_i on uniform knots over one turn, four times continuously differentiable, and penalised by the
fourth differences of c (P-splines: Eilers and Marx 1996, Statistical Science 11, Eq. 7). Read as a Gaussian prior, the
penalty gives the noise, the weight of the penalty (Wahba 1985, Annals of Statistics 13, Eq. 1.8) and the standard
error of every derivative (Silverman 1985, JRSS B 47, section 6). Coefficients outside the event are zero, so that the
base circle is exactly zero, and no coefficient is negative, so that the lift is not. Degrees and mm inside.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import fminbound
from scipy.sparse import csr_array
from scipy.special import comb

DEGREE = 5
BAND = 2 * DEGREE + 1
"""Diagonals of the equations from the main one down: two knots on the ring are at most twice as far apart in them."""
PENALTY_ORDER = 4
"""Fourth differences estimated the acceleration best on the tables of experiments/measured_tables.py (two seeds each):
third ones leave 1.1 to 2 times the error, and generalised cross validation in place of the likelihood takes the coarse
tables (1 and 2 deg) for noise-free."""
WEIGHTS = np.arange(-18.0, 16.0, 3.0)
"""Logarithms of the penalty's weight that are tried before the best is refined. Below, the equations of knots denser
than rows are singular to rounding."""
_CARDINAL = BSpline.basis_element(np.arange(DEGREE + 2.0), extrapolate=False)


@dataclass(frozen=True)
class Fit:
    """A spline through noisy rows: `coefficients` (n) [mm] on n knots, `free` the indices not held at zero."""

    coefficients: np.ndarray
    free: np.ndarray
    weight: float  # logarithm of the penalty's weight
    noise: float  # standard deviation of a row [mm]
    covariance: np.ndarray  # (k, k) of the free coefficients over noise^2
    residuals: np.ndarray  # (r) row less spline [mm]
    leverage: np.ndarray  # (r) how far the spline follows a row's own error, 0 to 1

    def studentised(self) -> np.ndarray:
        """Residuals over their own standard deviation, shape (r)."""
        return self.residuals / (self.noise * np.sqrt(np.maximum(1.0 - self.leverage, 1e-12)))

    def acceleration_error(self) -> tuple[float, float]:
        """Acceleration [mm/deg^2]: root mean square of its standard error over the event, and its largest value."""
        count = len(self.coefficients)
        at = (self.free - 2.5) * (360.0 / count)  # middle of each free basis function
        rows = basis(at, count, 2)[:, self.free]
        variance = _quadratic_forms(rows, self.covariance)
        return self.noise * float(np.sqrt(variance.mean())), float(np.abs(rows @ self.coefficients[self.free]).max())

    def pieces(self) -> PPoly:
        """The spline over one turn from 0, angle [deg] and lift [mm], pieces on the base circle joined."""
        count = len(self.coefficients)
        knots = np.arange(-DEGREE, count + DEGREE + 1) * (360.0 / count)
        all_pieces = PPoly.from_spline(BSpline(knots, np.append(self.coefficients, self.coefficients[:DEGREE]), DEGREE))
        c = all_pieces.c[:, DEGREE : DEGREE + count]
        zero = ~np.any(c, axis=0)
        kept = ~(zero & np.append(False, zero[:-1]))
        return PPoly(c[:, kept], np.append(knots[DEGREE : DEGREE + count][kept], 360.0))


def basis(degrees: np.ndarray, count: int, order: int = 0) -> csr_array:
    """Values (r, count) of the periodic basis functions, or of a derivative, at `degrees` (r); knots at 360 i/count.

    Function i stands on the knots i-5 to i+1.
    """
    h = 360.0 / count
    piece = np.floor(degrees / h).astype(int)
    local = (degrees / h - piece)[:, None] + DEGREE - np.arange(DEGREE + 1)
    shape = _CARDINAL.derivative(order) if order else _CARDINAL
    values = np.nan_to_num(shape(local)) / h**order
    columns = np.mod(piece[:, None] + np.arange(DEGREE + 1), count)
    rows = np.repeat(np.arange(len(degrees)), DEGREE + 1)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(len(degrees), count))


def fitted(degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray, weight: float | None = None) -> Fit:
    """The spline through rows `degrees`, `lift` [mm] (r), its coefficients `free` (k) in cyclic order, others zero.

    Without `weight` the one of largest restricted likelihood is taken.
    """
    if len(free) == count:  # cyclic: neighbours on the ring come near each other by going both ways round at once
        free = np.stack([free, free[::-1]], axis=1).ravel()[:count]
    rows = basis(degrees, count)[:, free]
    normal, right = _bands(rows.T @ rows), rows.T @ lift
    penalty = _bands(_penalty(count)[free][:, free])
    rank = len(free) - (len(free) == count)  # a constant over the whole turn costs nothing

    def solved(log_weight: float):
        factor = cholesky_banded(normal + np.exp(log_weight) * penalty, lower=True)
        c = cho_solve_banded((factor, True), right)
        turn = np.zeros(count)
        turn[free] = c
        for _ in range(PENALTY_ORDER):
            turn = np.roll(turn, -1) - turn
        bent = np.exp(log_weight) * _scale(count) * float(turn @ turn)
        return factor, c, (float(np.sum((lift - rows @ c) ** 2)) + bent) / len(lift)

    def cost(log_weight: float) -> float:
        factor, _, variance = solved(log_weight)
        return len(lift) * np.log(variance) + 2 * np.log(factor[0]).sum() - rank * log_weight

    if weight is None:
        best = WEIGHTS[int(np.argmin([cost(w) for w in WEIGHTS]))]
        weight = float(np.asarray(fminbound(cost, best - 3, best + 3, xtol=0.05)))
    factor, c, variance = solved(weight)
    covariance = cho_solve_banded((factor, True), np.eye(len(free)))
    coefficients = np.zeros(count)
    coefficients[free] = c
    leverage = _quadratic_forms(rows, covariance)
    return Fit(coefficients, free, weight, float(np.sqrt(variance)), covariance, lift - rows @ c, leverage)


def fitted_non_negative(degrees: np.ndarray, lift: np.ndarray, count: int, free: np.ndarray) -> Fit:
    """As `fitted`, its ends drawn in until no coefficient is negative: the feet lie where the lift leaves the noise."""
    fit = fitted(degrees, lift, count, free)
    while True:
        c = fit.coefficients[free]
        negative, top = np.flatnonzero(c < 0), int(np.argmax(c))
        if len(negative) == 0:
            return fit
        first = int(negative[negative < top].max(initial=-1)) + 1
        last = int(negative[negative > top].min(initial=len(c)))
        free = free[first:last]
        fit = fitted(degrees, lift, count, free, fit.weight)


def _penalty(count: int) -> csr_array:
    """Integral of the squared fourth derivative by its differences at uniform knots, cyclic, shape (count, count)."""
    order = PENALTY_ORDER
    weights = [(-1) ** d * comb(2 * order, order + d, exact=True) for d in range(-order, order + 1)]
    columns = np.mod(np.arange(count)[:, None] + np.arange(-order, order + 1), count)
    rows = np.repeat(np.arange(count), 2 * order + 1)
    values = np.tile(weights, count) * _scale(count)
    return csr_array((values, (rows, columns.ravel())), shape=(count, count))


def _scale(count: int) -> float:
    """Integral over the angle [deg] of a squared fourth derivative, over its sum of squared differences."""
    return (count / 360.0) ** (2 * PENALTY_ORDER - 1)


def _bands(matrix) -> np.ndarray:
    """Diagonals of a symmetric matrix from the main one down, shape (BAND, k), as LAPACK stores them."""
    size = matrix.shape[0]
    return np.array([np.pad(matrix.diagonal(-k), (0, min(k, size))) for k in range(BAND)])


def _quadratic_forms(rows: csr_array, matrix: np.ndarray) -> np.ndarray:
    """The diagonal of rows @ matrix @ rows.T."""
    return np.asarray(rows.multiply(rows @ matrix).sum(axis=1)).ravel()
