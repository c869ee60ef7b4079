"""The text that `camopt cam` prints: a cam against the scene's limits, its contact and its Hertz stress."""

import numpy as np

from camopt.cam.contact import Contact
from camopt.cam.geometry import DURATION_LIFTS_MM, contact, crossing, sign_changes
from camopt.cam.hertz import HertzStress, contact_width, film_ratio, hertz_stress
from camopt.cam.lift import Lift
from camopt.measure.limits import broken_by_shape, drawing_excess, steps_at
from camopt.measure.rounded import moving_average
from camopt.scene import Scene
from camopt.scene.design import Design
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.rest import static_forces
from camopt.scene.units import DEG, MM
from camopt.study.cam_force import driven_element, last_revolution

STATIC_STEP_DEG = 0.5
BAND_SPEEDS = 11
"""Number of speeds over the band among which the largest Hertz stress is sought."""
SAME_DURATION_DEG = 1e-3
SAME_LIFT = 1e-6
"""Differences in duration, and in lift relative to the maximum, that the rounding of a table explains."""
MOST_SHOWN = 8
"""Most numbers of one parameter that the first line shows: enough for the exponents and powers of every family."""
DERIVATIVES = ("lift", "velocity", "acceleration", "jerk")
"""Names by the order of the derivative."""
LABELS = {
    "smallest_convex_radius_mm": "smallest convex radius",
    "smallest_concave_radius_mm": "smallest concave radius",
    "eccentricity_max_mm": "eccentricity, largest",
    "eccentricity_min_mm": "eccentricity, smallest",
    "face_width_needed_mm": "face width needed",
    "pressure_angle_max_deg": "largest pressure angle",
    "valve_ratio_min": "valve over contact, least",
    "valve_ratio_max": "valve over contact, most",
}
"""Labels of the quantities of a contact; the key of a dimensional quantity ends in its unit."""


def sheet(scene: Scene, lift: Lift, speed_rpm: float | None = None) -> list[str]:
    """Lines of text on limits and durations and, with [geometry], the contact; at a speed also Hertz stress, velocities
    and oil film. Derivatives of a rounded table are those of its moving average (`camopt.measure.rounded`)."""
    law, rounding = moving_average(lift)
    lines = _limits(scene, lift, law)
    lines += [f"{rounding}."] * bool(rounding)
    if scene.geometry is not None:
        follower_contact = contact(law, scene.geometry)
        lines += _contact(lift, follower_contact)
        if speed_rpm is not None and follower_contact.contour_fault is not None:
            lines.append("Hertz stress: none without a contour that gives the follower this lift")
        elif speed_rpm is not None:
            lines += _stress(scene, law, scene.geometry, speed_rpm)
    return lines


def _limits(scene: Scene, lift: Lift, law: Lift) -> list[str]:
    """The cam against the scene's limits; the derivatives are those of `law`."""
    design = scene.required_design
    ratio = lift.area_ratio_in(design)
    parameters = {k: round(v, 4) if k == "knot_deg" else v for k, v in lift.parameters.items()}
    lines = [
        f"{lift.family}: " + ", ".join(f"{k} = {_brief(v)}" for k, v in parameters.items() if k != "mended"),
        f"duration       {2 * lift.half_duration / DEG:.4f} deg (scene: {design.duration_deg:g})",
        f"maximum lift   {lift.max_lift / MM:.6f} mm (limit {design.max_lift_mm:g})",
        f"area           {lift.area / MM / DEG:.4f} mm deg, area ratio {ratio:.6f}",
    ]
    limits = (
        ("acceleration", 2, design.acceleration_min_mm_per_deg2, design.acceleration_max_mm_per_deg2),
        ("jerk", 3, design.jerk_max_mm_per_deg3 and -design.jerk_max_mm_per_deg3, design.jerk_max_mm_per_deg3),
    )
    snap = design.snap_max_mm_per_deg4
    limits += (("snap", 4, -snap, snap),) if snap is not None else ()
    for name, order, low, high in limits:
        least, most = (value * DEG**order / MM for value in law.extremes(order))
        limit = f"limits {'none' if low is None else f'{low:g}'} to {'none' if high is None else f'{high:g}'}"
        steps = _steps(law, design, order)
        lines.append(f"{name:<14} {steps}{least:.6f} to {most:.6f} mm/deg^{order} ({limit})")
    if design.waves_max is not None:
        lines.append(f"waves          {len(sign_changes(law))} sign changes of the jerk (limit {design.waves_max})")
    broken = set(broken_by_shape(lift, design))
    lines += [f"{key}: {'broken' if key in broken else 'kept'}" for key in drawing_excess(lift, design)]
    return lines + remarks(lift, design)


def _steps(law: Lift, design: Design, order: int) -> str:
    """The statement that a derivative is infinite where a lower one jumps, which precedes its values elsewhere, or "".

    The snap is judged between the ramps only, because every cam's jerk jumps at the ramp ends.
    """
    within = law.half_duration if order == len(DERIVATIVES) else np.inf
    for below in range(1, order):
        at = steps_at(law, design, below, within) / DEG
        if len(at):
            angles = ", ".join(f"{angle:.4g}" for angle in at)
            return f"infinite: the {DERIVATIVES[below]} steps at {angles} deg; elsewhere "
    return ""


def _brief(value: object) -> str:
    """A parameter without rounding digits; a long list is replaced by its length and a reference to design.json."""
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, list | tuple) and len(value) > MOST_SHOWN:
        return f"{len(value)} numbers, in design.json"
    return str(value)


def remarks(lift: Lift, design: Design) -> list[str]:
    """Remarks on unusual properties: another duration, too much lift, repairs of the lift table, added lift."""
    sentences = []
    longer = 2 * lift.half_duration / DEG - design.duration_deg
    if abs(longer) > SAME_DURATION_DEG:
        sentences.append(
            f"The cam is {abs(longer):.4g} deg {'longer' if longer > 0 else 'shorter'} between its ramp tops than the "
            f"scene's duration_deg of {design.duration_deg:g}: its area ratio does not compare with the scene's cams."
        )
    if lift.max_lift > design.max_lift_mm * MM * (1 + SAME_LIFT):
        sentences.append(
            f"Its lift exceeds the scene's max_lift_mm of {design.max_lift_mm:g}, by which the area ratio is divided: "
            f"the ratio may exceed one."
        )
    sentences += [f"Of its table: {sentence}." for sentence in lift.parameters.get("mended", [])]
    if lift.parameters.get("outlier_lines"):
        lines = ", ".join(map(str, lift.parameters["outlier_lines"]))
        sentences.append(f"Of its table: outlying rows were left out: lines {lines}.")
    added_mm = lift.parameters.get("added_lift_mm")
    if added_mm is not None:
        sentences.append(
            f"The table ends above the base circle: the scene's ramp was added on {lift.parameters['cut_ramps']} "
            f"flank(s), {lift.parameters['added_deg']:g} deg and up to {added_mm:g} mm of lift that were not measured."
        )
    if "acceleration_error_percent" in lift.parameters:
        sentences.append(
            f"With 95 % confidence the acceleration is within {lift.parameters['acceleration_error_percent']:g} % of "
            f"its largest value (root mean square over the event), its extremes within "
            f"{lift.parameters['peak_error_percent']:g} %."
        )
    return sentences


def _contact(lift: Lift, follower_contact: Contact) -> list[str]:
    """Quantities and faults of the contact, and the durations at the usual lifts."""
    geometry = follower_contact.geometry
    body = "pad" if geometry.roller_radius_mm is None else "roller"
    follower = f"{geometry.follower} " + (f"with a {body}" if geometry.follower in SWINGING else "follower")
    if (radius := geometry.contact_radius_mm) is not None:
        follower += f" of radius {radius:g} mm"
    lines = [f"{follower} on a base circle of radius {geometry.base_radius_mm:g} mm"]
    if geometry.assumed:
        lines.append(f"  assumed: {', '.join(geometry.assumed)}")
    for key, value in follower_contact.figures().items():
        unit = key.rpartition("_")[2] if key.endswith(("_mm", "_deg")) else ""
        if value is not None:
            lines.append(f"  {LABELS[key]:<24} {value:10.4f} {unit}".rstrip())
        elif key == "smallest_concave_radius_mm":
            lines.append(f"  {LABELS[key]:<24} {'none':>10}")
    for name, height in DURATION_LIFTS_MM.items():
        label = f"open above {name.replace('_', ' ')}"
        if height * MM >= lift.max_lift:
            lines.append(f"  {label:<24} {'never':>10}")
            continue
        opening, closing = (angle / DEG for angle in crossing(lift, height * MM))
        lines.append(f"  {label:<24} {opening:10.4f} to {closing:.4f} deg, {closing - opening:.4f} deg long")
    return lines + [f"  fault: {sentence}" for sentence in follower_contact.faults()]


def _stress(scene: Scene, lift: Lift, geometry: Geometry, speed_rpm: float) -> list[str]:
    """The largest Hertz stress in the band, at a speed and at standstill, with the surface velocities at that speed."""
    width = contact_width(geometry) / MM
    source = "contact_width_mm" if geometry.contact_width_mm else "face_width_mm"
    moving, method = dynamic_stress(scene, lift, speed_rpm)
    at_rest = static_stress(scene, lift)
    band = [float(speed) for speed in np.linspace(*scene.required_operation.band_rpm, BAND_SPEEDS)]
    stresses = [(moving, speed_rpm), *((dynamic_stress(scene, lift, speed)[0], speed) for speed in band)]
    worst, at_rpm = max(stresses, key=lambda entry: entry[0].largest[0])
    within = f"most in band, {at_rpm:.0f} r/min"
    lines = [*_surfaces(scene, lift, moving, speed_rpm), f"Hertz stress over a line of {width:g} mm ({source})"]
    for name, stress in ((within, worst), (f"at {speed_rpm:g} r/min ({method})", moving), ("standing still", at_rest)):
        largest = stress.figures()
        share = share_borne(largest["hertz_stress_MPa"], geometry)
        lines.append(
            f"  {name:<24} {largest['hertz_stress_MPa']:10.1f} MPa at {largest['cam_angle_deg']:.1f} deg, "
            f"normal force {largest['normal_force_N']:.1f} N{', ' * bool(share)}{share}"
        )
    return lines


def share_borne(stress_MPa: float, geometry: Geometry) -> str:
    """A stress as a percentage of the materials' limit; empty where the scene does not state the limit."""
    limit = geometry.hertz_max_MPa
    return "" if limit is None else f"{100 * stress_MPa / limit:.0f} % of {limit:g} MPa"


def _surfaces(scene: Scene, lift: Lift, moving: HertzStress, speed_rpm: float) -> list[str]:
    """Velocities of the two surfaces at their contact, and the oil film where the scene has an oil."""
    cam_speed = scene.cam_speed(speed_rpm)
    along = contact(lift, scene.required_geometry, moving.theta)
    entrained = along.entrainment * cam_speed
    lines = [
        f"surfaces at {speed_rpm:g} r/min",
        f"  {'entrainment velocity':<24} {entrained.min():10.3f} to {entrained.max():.3f} m/s",
        f"  {'sliding velocity, most':<24} {np.abs(along.sliding).max() * cam_speed:10.3f} m/s",
    ]
    ratio = film_ratio(along, cam_speed, moving.force)
    if ratio is not None:
        on_flanks = np.where(np.isfinite(ratio), ratio, 0.0)
        at, top = int(np.argmax(on_flanks)), int(np.argmax(lift(moving.theta)))
        lines.append(
            f"  {'film thickness ratio':<24} {on_flanks[at]:10.2f} at most, at "
            f"{np.mod(moving.theta[at] / DEG + 180, 360) - 180:.1f} deg, {ratio[top]:.2f} at the nose"
        )
    return lines


def dynamic_stress(scene: Scene, lift: Lift, speed_rpm: float) -> tuple[HertzStress, str]:
    """The stress over one cam revolution at a speed, and the method: event-exact, or rkg where event-exact refuses.

    Raises InputError as `hertz_stress` and `camopt.study.cam_force.last_revolution` do.
    """
    motion, method = last_revolution(scene, lift, speed_rpm)
    return hertz_stress(lift, scene.required_geometry, motion.angle, motion.force[:, driven_element(scene)[1]]), method


def static_stress(scene: Scene, lift: Lift) -> HertzStress:
    """The stress at standstill, every `STATIC_STEP_DEG`; raises InputError as `hertz_stress` does."""
    train, element = driven_element(scene)
    theta = np.arange(-180.0, 180.0, STATIC_STEP_DEG) * DEG
    return hertz_stress(lift, scene.required_geometry, theta, static_forces(train, lift(theta))[:, element])
