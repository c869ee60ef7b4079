"""Cams in sections: boundary conditions in a table, one short function per section of the opening flank.

A table states lift, velocity, acceleration and jerk at the start and the end of every section, as the tables of Kodama
et al. do. A section has as many terms as conditions, which makes it unique (their Eq. (4), where the terms are powers).
The levels are the accelerations and jerks at the borders that the table leaves to the designer. For fixed section
angles the pieces, the area and every limit are linear in the levels. The arrays are NumPy's or JAX's.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from camopt.cam.lift import Lift, mirrored_pieces, with_ramps
from camopt.cam.polynomials import MATCHED, falling, osculating_pieces, power_derivatives
from camopt.cam.ramps import Ramp
from camopt.scene.units import DEG, MM

U = None
"""A boundary condition that is not stated, in the tables' own notation."""
QUANTITIES = ("lift", "velocity", "acceleration", "jerk")
RAMP = {"y_r": 0, "v_r": 1}
"""Columns of the ramp's height and velocity; those of the levels follow."""
OSCULATING_PARTS = 4
"""Number of pieces of a section whose terms are not powers; they approximate a half wave to 1e-13 of its amplitude."""

Cell = str | float | None
Terms = Callable[[int, np.ndarray, int], np.ndarray]


def powers(count: int, u: np.ndarray, order: int) -> np.ndarray:
    """The derivative `order` of 1, u, u^2, ... at u (k), shape (k, count): the terms of Eq. (4)."""
    return power_derivatives(np.arange(count), np.asarray(u, dtype=float), order)


@dataclass(frozen=True)
class Section:
    """Boundary conditions (start, end) of one section; each is a symbol, 0, or U.

    A symbol is the ramp's (y_r, v_r), a level of the table, or otherwise the value at the end of the previous section.
    `terms` gives the functions of 0 <= u <= 1 that make up the section.
    """

    lift: tuple[Cell, Cell]
    velocity: tuple[Cell, Cell]
    acceleration: tuple[Cell, Cell]
    jerk: tuple[Cell, Cell]
    terms: Terms = powers

    @cached_property
    def conditions(self) -> list[tuple[int, int, str | float]]:
        """Order of the derivative, place (0 start, 1 end) and value of every condition that is stated."""
        cells = ((k, end, getattr(self, name)[end]) for k, name in enumerate(QUANTITIES) for end in (0, 1))
        return [(k, end, cell) for k, end, cell in cells if cell is not None]


@dataclass(frozen=True)
class SectionTable:
    """A family's sections, its free levels, and the levels that the conditions at the nose determine.

    The first letter of a level gives the order of its derivative (v, a, j). One level in `closed_by` satisfies the
    condition that the lift ends at the maximum lift; a second one satisfies zero velocity at the end, if no section
    states it. `multiples` has the names of fixed multiples of a level, with the factor and the level.
    """

    family: str
    sections: tuple[Section, ...]
    levels: tuple[str, ...]
    closed_by: tuple[str, ...]
    multiples: tuple[tuple[str, float, str], ...] = ()

    @cached_property
    def symbols(self) -> dict[str | float, np.ndarray]:
        """The row of every known symbol, by which it is computed from x = (ramp height, ramp velocity, levels)."""
        unit = np.eye(2 + len(self.levels))
        rows: dict[str | float, np.ndarray] = {s: unit[i] for s, i in RAMP.items()}
        rows |= {level: unit[2 + i] for i, level in enumerate(self.levels)}
        rows |= {s: factor * rows[level] for s, factor, level in self.multiples}
        return rows | {0: np.zeros(len(unit))}

    def orders(self) -> np.ndarray:
        """Order of the derivative of every level (m)."""
        return np.array(["yvaj".index(level[0]) for level in self.levels])

    def units(self) -> np.ndarray:
        """SI value of the unit mm/deg^order of every level (m)."""
        return MM / DEG ** self.orders()


@dataclass(frozen=True)
class Flank:
    """The opening flank for fixed section angles; its local coefficients [m/rad^k] are pieces (p, q, n) @ x.

    `borders` (p + 1) [rad] run from 0 at the ramp top to half the duration at the nose; x = (ramp height [m], ramp
    velocity [m/rad], levels [m/rad^order]).
    """

    borders: np.ndarray
    pieces: np.ndarray

    @cached_property
    def relative(self) -> np.ndarray:
        """Coefficients (p, q, n) in powers of the angle relative to the width of each piece."""
        widths = np.diff(self.borders)[:, None] ** np.arange(self.pieces.shape[1])
        return self.pieces * widths[:, :, None]

    def end(self, order: int) -> np.ndarray:
        """Row (n) of the derivative `order` at the nose."""
        width = self.borders[-1] - self.borders[-2]
        k = np.arange(self.pieces.shape[1])
        return falling(k, order) * width ** np.maximum(k - order, 0) @ self.pieces[-1]

    def area(self) -> np.ndarray:
        """Row (n) of the area of both flanks [m rad]."""
        terms = self.relative / (np.arange(self.pieces.shape[1]) + 1)[:, None]
        return 2 * np.einsum("p,pqn->n", np.diff(self.borders), terms)

    def lift(self, x: np.ndarray, ramp: Ramp, family: str, parameters: dict) -> Lift:
        """The symmetric cam for levels x (n) between two equal ramps."""
        return with_ramps(*self.event(x), ramp, ramp, family, parameters)

    def event(self, x) -> tuple[np.ndarray, np.ndarray]:
        """Borders [rad] and pieces of both flanks, the nose at zero, for levels x (n)."""
        xp = self.borders.__array_namespace__()
        up = self.pieces @ x
        down = mirrored_pieces(up, xp.diff(self.borders))
        borders = xp.concatenate([self.borders - self.borders[-1], (self.borders[-1] - self.borders[::-1])[1:]])
        return borders, xp.concatenate([up, down])


def opening_flank(table: SectionTable, angles: np.ndarray) -> Flank:
    """The opening flank of a table for section angles [rad] in an array of NumPy or JAX, section by section."""
    xp = angles.__array_namespace__()
    symbols = table.symbols
    before = np.zeros((len(QUANTITIES), 2 + len(table.levels)))
    borders, pieces = [np.zeros(1)], []
    for section, angle in zip(table.sections, angles, strict=True):
        conditions = section.conditions
        count = len(conditions)
        system, ends, orders = _system(section)
        # a start whose symbol is not known has the value at the end of the previous section
        rows = [symbols[cell] if end or cell in symbols else before[k] for k, end, cell in conditions]
        coefficients = xp.linalg.solve(system, xp.stack(rows) * angle**orders)
        before = ends / angle ** np.arange(len(QUANTITIES))[:, None] @ coefficients
        u, unit = _unit(section.terms, count)
        borders.append(borders[-1][-1] + angle * u[1:])
        pieces.append(unit / angle ** np.arange(unit.shape[1])[:, None] @ coefficients)
    widest = max(p.shape[1] for p in pieces)
    # in NumPy the padding takes more time than the equations of the section
    short = [np.zeros((len(p), widest - p.shape[1], p.shape[2])) for p in pieces]
    padded = [xp.concatenate([p, zero], axis=1) if zero.size else p for p, zero in zip(pieces, short, strict=True)]
    return Flank(xp.concatenate(borders), xp.concatenate(padded))


@cache
def _system(section: Section) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrix (count, count) of a section's terms in its conditions, the derivatives of order 0 to 3 of the terms at the
    end of the section, and the orders (count, 1) of the conditions."""
    conditions = section.conditions
    count = len(conditions)
    system = np.stack([section.terms(count, np.array([end]), k)[0] for k, end, _ in conditions])
    ends = np.stack([section.terms(count, np.ones(1), k)[0] for k in range(len(QUANTITIES))])
    return system, ends, np.array([[k] for k, _, _ in conditions])


@cache
def _unit(terms: Terms, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Borders (p + 1) of a section of width 1, and its terms as local polynomial pieces (p, q, count)."""
    if terms is powers:
        return np.array([0.0, 1.0]), np.eye(count)[None]
    u = np.linspace(0.0, 1.0, OSCULATING_PARTS + 1)
    derivatives = np.stack([terms(count, u, k) for k in range(MATCHED)], axis=1)
    return u, np.stack([osculating_pieces(u, derivatives[:, :, i]) for i in range(count)], axis=2)


def close_flank(table: SectionTable, flank: Flank, x: np.ndarray, max_lift: float, by: Sequence[str]) -> np.ndarray:
    """x (n) with the levels `by` changed so that the lift ends at the maximum lift [m], with two levels at rest."""
    columns = [2 + table.levels.index(level) for level in by]
    xp = flank.borders.__array_namespace__()
    rows = xp.stack([flank.end(k) for k in range(len(columns))])
    wanted = xp.asarray([max_lift, 0.0])[: len(columns)]
    chosen = np.eye(len(x))[:, columns]
    x = x * (1 - chosen.sum(axis=1))
    for _ in range(2):  # the second solve reduces the error of the end lift to rounding
        x = x + chosen @ xp.linalg.solve(rows[:, columns], wanted - rows @ x)
    return x
