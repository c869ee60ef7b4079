"""Masses, stiffnesses, dampings, preloads and gaps of a valve train from its measured valve lift, with intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.stats import f as fisher
from scipy.stats import norm
from scipy.stats import t as student

from camopt.cam.lift import Lift
from camopt.scene import InputError, Scene
from camopt.scene.units import DEG, MM, UM
from camopt.study.identify.lift_fit import Fitted, FreeParameters, LiftFit, Series, fits_from_starts

WIDEST = np.log(2.0)
"""Half-width of an interval in the logarithm beyond which a parameter counts as not identified: a linear analysis is
not reliable over more than a factor of two."""
ROUNDING = 1e-7
"""Singular value, relative to the largest, below which a direction is rounding of the differences, hence unknown."""
SURPRISING = 5.0
"""Allowed deviation of the residual's noise and correlation from their expected values [standard deviations]."""
ESTIMATE_SPREAD = 3.1
"""Relative standard deviation of the square of `measured_noise`, times the root of the number of samples."""
JACOBIANS_AGREE = 1e-2
"""Largest relative distance of the differences' Jacobian from the adjoint; beyond, the motion is too sensitive."""


@dataclass(frozen=True)
class MeasuredLift:
    """A measured valve lift at one speed: position of the valve (m) at ascending cam angles (m).

    The position is zero in the scene's installed position, unless `identify` is told otherwise. Angles count from -180,
    where the first revolution begins, and continue beyond 180 in later revolutions.
    """

    speed_rpm: float  # crankshaft
    cam_angle_deg: np.ndarray
    valve_mm: np.ndarray


@dataclass(frozen=True)
class Identification:
    """The identified parameters with their intervals.

    `table` has the coordinate `parameter` (p) with `start`, `estimate`, `low`, `high` (in the units of the names;
    infinite where not identified), `relative_error` (standard error of the logarithm) and `identified`; nothing is
    identified where a remark speaks against the fit. `correlation` (p, p) is that of the estimates, NaN where unknown.
    `directions` are combinations of the parameters, weakest first, with their `relative_error`: the noise divided by
    the singular value of the Jacobian with respect to the logarithms.
    """

    scene: Scene  # with the estimated values
    table: xr.Dataset
    correlation: xr.DataArray
    directions: xr.Dataset
    confidence: float
    noise_um: float  # root mean square of the residual over its degrees of freedom
    residual_um: tuple[np.ndarray, ...]  # computed less measured, by series
    measured: tuple[MeasuredLift, ...]
    jacobian_error: float  # relative distance between the differences' Jacobian and the adjoint
    steps: int
    remarks: tuple[str, ...]  # reasons against the intervals; empty where they are reliable

    @property
    def verdict(self) -> str:
        """The verdict "identified" where the fit converged, leaves only noise and determines every parameter; "partly
        identified" where some stay open; "not identified" where none is determined or a remark opposes the fit."""
        identified = self.table["identified"].values
        return "identified" if identified.all() else "partly identified" if identified.any() else "not identified"

    def plot(self):
        """Estimates with their intervals, and the residual, as a matplotlib Figure."""
        from camopt.plots.studies import identification

        speeds = [m.speed_rpm for m in self.measured]
        angles = [m.cam_angle_deg for m in self.measured]
        return identification(self.table, speeds, angles, self.residual_um, self.noise_um)

    def _repr_html_(self) -> str:
        remarks = "".join(f"<p>{r}</p>" for r in self.remarks)
        return f"<p>{self.verdict}</p>" + self.table.to_dataframe().to_html(float_format="%.5g") + remarks


def identify(
    scene: Scene,
    cam: Lift,
    measured: Sequence[MeasuredLift],
    free: Sequence[str],
    *,
    settle: int = 0,
    zero_known: bool = True,
    noise_um: float | None = None,
    confidence: float = 0.95,
) -> Identification:
    """Least-squares estimates of the parameters `free` (p) from measured valve lifts, starting at the scene's values.

    `free` holds names such as `valve.mass_kg`, `train.stiffness_N_per_m`, `seat.gap_mm`; `coil_*.damping_N_s_per_m`
    moves all matching numbers by one factor. The motion starts from rest, `settle` whole revolutions before the angle
    -180 of the data. With `zero_known=False` the sensor's zero is unknown in each series. `noise_um` is the sensor's
    noise, by default estimated from the samples. `camopt.study.identify` describes the intervals, which have this
    `confidence`. Raises InputError for unusable data or names, and MotionRefused where the start values give no motion.
    """
    if not 0 < confidence < 1 or settle < 0 or int(settle) != settle:
        raise InputError(f"identify: confidence {confidence}, settle {settle}: expected 0 to 1, and an integer")
    parameters = FreeParameters(scene, free)
    series = [_series(scene, m, int(settle)) for m in measured]
    fit = LiftFit(parameters, cam, series, zero_known)
    count = sum(len(s.angle) for s in series) - (0 if zero_known else len(series))
    if count <= len(free):
        raise InputError(f"identify: {count} samples for {len(free)} parameters: measure more")
    noise = (measured_noise(series), True) if noise_um is None else (noise_um * UM, False)
    fits = fits_from_starts(fit, largest_residual(*noise, count) ** 2 * count)
    best = fits[0]
    jacobian = fit.jacobian(best.logs)
    estimate = _Estimate(best.residual, jacobian, count, confidence)
    residuals = tuple(piece / UM for piece in np.split(best.residual, fit.borders))
    # distance between the differences' Jacobian and the adjoint's, along one random combination of samples
    bar = np.random.default_rng(0).standard_normal(len(best.residual))
    distance = np.abs(fit.pulled_back(best.logs, best.motions, bar) - jacobian.T @ bar).max()
    error = float(distance / (np.linalg.norm(jacobian, axis=0).max() * np.linalg.norm(bar)))
    remarks = tuple(_remarks(fits, residuals, *noise, estimate, error))
    return Identification(
        scene=parameters.moved_scene(best.logs),
        table=_table(parameters, best, estimate, sound=not remarks),
        correlation=estimate.correlation(list(free)),
        directions=estimate.directions(list(free)),
        confidence=confidence,
        noise_um=estimate.noise / UM,
        residual_um=residuals,
        measured=tuple(measured),
        jacobian_error=error,
        steps=best.steps,
        remarks=remarks,
    )


def _series(scene: Scene, measured: MeasuredLift, settle: int) -> Series:
    angle, valve = np.asarray(measured.cam_angle_deg, float), np.asarray(measured.valve_mm, float)
    where = f"identify: measured lift at {measured.speed_rpm:g} r/min"
    if scene.operation is None or scene.valve is None:
        raise InputError(f"scene {scene.name}: identify needs valve, seat and [operation]")
    if not (np.isfinite(measured.speed_rpm) and measured.speed_rpm > 0):
        raise InputError(f"{where}: a crankshaft speed above 0 r/min is needed")
    if angle.ndim != 1 or angle.shape != valve.shape or len(angle) < 2:
        raise InputError(f"{where}: as many valve positions as angles are needed, at least two")
    if not (np.all(np.isfinite(angle)) and np.all(np.isfinite(valve))):
        raise InputError(f"{where}: every angle and position must be a finite number: leave out what is missing")
    if angle[0] < -180 or np.any(np.diff(angle) <= 0):
        raise InputError(f"{where}: the angles must ascend from -180 deg or later: sort them, and count on past 180")
    return Series(scene.cam_speed(measured.speed_rpm), angle * DEG + 2 * np.pi * settle, valve * MM)


def largest_residual(noise: float, estimated: bool, freedom: int) -> float:
    """The largest residual [m], over this many degrees of freedom, that the sensor's noise explains. The noise is a
    standard deviation [m], stated or `estimated` from the samples."""
    spread = np.sqrt((2.0 + (ESTIMATE_SPREAD**2 if estimated else 0.0)) / freedom)
    return noise * float(np.sqrt(1 + SURPRISING * spread))


def measured_noise(series: Sequence[Series]) -> float:
    """Standard deviation [m] of white noise in sampled positions; infinite for fewer than four samples. It is the
    median, which impacts do not change, of third differences, which are small for a smooth motion (Gasser, Sroka and
    Jennen-Steinmetz 1986, Biometrika 73). Motion that the samples are too coarse to resolve counts as noise."""
    differences = []
    for samples in (samples for samples in series if len(samples.angle) >= 4):
        at, valve = np.lib.stride_tricks.sliding_window_view(np.stack([samples.angle, samples.valve]), 4, axis=1)
        weights = 1 / np.prod(at[:, :, None] - at[:, None, :] + np.eye(4), axis=2)
        weights /= np.linalg.norm(weights, axis=1, keepdims=True)
        differences.append(abs(np.sum(weights * valve, axis=1)))
    return float(np.median(np.concatenate(differences)) / norm.ppf(0.75)) if differences else np.inf


class _Estimate:
    """The covariance of the logarithms from the Jacobian at the estimate, by singular directions."""

    def __init__(self, residual: np.ndarray, jacobian: np.ndarray, count: int, confidence: float):
        _, s, self.vectors = np.linalg.svd(jacobian, full_matrices=False)
        squares = float(residual @ residual)
        # directions that the fit did not move use no degree of freedom
        self.freedom = count - int(np.sum(s > np.sqrt(squares / len(residual))))
        self.noise = float(np.sqrt(squares / self.freedom))
        unknown = s <= ROUNDING * s[0]
        self.errors = np.divide(self.noise, s, out=np.full(len(s), np.inf), where=~unknown)
        self.touched = np.any(np.abs(self.vectors[unknown]) > np.sqrt(ROUNDING), axis=0)
        self.covariance = (self.vectors[~unknown].T * self.errors[~unknown] ** 2) @ self.vectors[~unknown]
        self.error = np.where(self.touched, np.inf, np.sqrt(np.diag(self.covariance)))
        self.half_width = student.ppf(0.5 + confidence / 2, self.freedom) * self.error

    def correlation(self, names: list[str]) -> xr.DataArray:
        scale = np.where(self.touched, np.nan, np.sqrt(np.diag(self.covariance)))
        coordinates = {"parameter": names, "other": names}
        return xr.DataArray(self.covariance / np.outer(scale, scale), coordinates, ("parameter", "other"))

    def directions(self, names: list[str]) -> xr.Dataset:
        variables = {"relative_error": ("direction", self.errors[::-1])}
        variables |= {"vector": (("direction", "parameter"), self.vectors[::-1])}
        return xr.Dataset(variables, {"direction": np.arange(len(self.errors)), "parameter": names})


def _table(parameters: FreeParameters, fitted: Fitted, estimate: _Estimate, sound: bool) -> xr.Dataset:
    start = np.array([tied.of(parameters.scene) for tied in parameters.tied])
    identified = (estimate.half_width <= WIDEST) & sound
    value, width = start * np.exp(fitted.logs), np.where(identified, estimate.half_width, 0.0)
    # the ends of a negative value's interval are exchanged; without identification the interval is infinite
    ends = np.sort(np.stack([value * np.exp(-width), value * np.exp(width)]), axis=0)
    ends = np.where(identified, ends, np.array([[-np.inf], [np.inf]]))
    columns = {"start": start, "estimate": value, "low": ends[0], "high": ends[1]}
    columns |= {"relative_error": estimate.error, "identified": identified}
    coords = {"parameter": [tied.name for tied in parameters.tied]}
    return xr.Dataset({name: ("parameter", column) for name, column in columns.items()}, coords)


def _remarks(fits: Sequence[Fitted], residuals, noise: float, estimated: bool, estimate: _Estimate, error: float):
    best = fits[0]
    if not best.converged:
        yield f"the fit did not converge in {best.steps} steps: start closer, or free fewer parameters"
    if error > JACOBIANS_AGREE:
        yield (
            f"differences and adjoint disagree by {error:.2g}: the motion is too sensitive (bounce, jump, or nearly); "
            "take lower speeds, or leave out the angles after closing"
        )
    if estimate.noise > largest_residual(noise, estimated, estimate.freedom):
        whose = "that the samples themselves show" if estimated else "of the sensor"
        yield (
            f"the residual of {estimate.noise / UM:.3g} um does not fall to the noise of {noise / UM:.3g} um "
            f"{whose}: the model misses something, or the start is too far off"
        )
    count, identified = len(best.logs), estimate.half_width <= WIDEST
    bound = best.squares + count * fisher.ppf(0.99, count, estimate.freedom) * estimate.noise**2  # the F test at 99 %
    differs = [np.abs(fit.logs - best.logs) > SURPRISING * estimate.error for fit in fits[1:] if fit.squares <= bound]
    if np.any([different[identified] for different in differs]):
        yield "another start leads to other values that fit as well: measure at more speeds, or free fewer parameters"
    # von Neumann's ratio of mean square difference to variance is 2 for white noise, with variance 4 / samples
    squares = sum(float(r @ r) for r in residuals)
    pairs = sum(float(r[1:] @ r[:-1]) for r in residuals)
    samples = sum(len(r) for r in residuals)
    correlated = pairs / squares * np.sqrt(samples) if squares > 0 else 0.0
    if correlated > SURPRISING:
        yield (
            f"neighbouring residuals correlate ({pairs / squares:.2f}, {correlated:.0f} standard deviations): "
            "the intervals, which take the noise as white, are too narrow"
        )
