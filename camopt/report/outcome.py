"""The outcome of a run as a table and sentences, for the report and for the end of `camopt optimize`."""

from camopt.measure.sweep import reserve_sentences
from camopt.measure.yield_words import (
    ENOUGH,
    HELD,
    advised_sentence,
    asked_sentence,
    ideal_sentence,
    share_sentence,
    spoiling_sentences,
    standing,
)
from camopt.report.folder import RunFolder
from camopt.report.limits import STATED, limit_in_words, where_and_source
from camopt.report.wording import in_words, shown
from camopt.scene.quantities import QUANTITIES, is_number, label_and_unit

NARROW_PERCENT = 2.0
"""Speed reserve above the band [%] below which it counts as narrow. Natural frequencies follow the square root of the
stiffness, so a spring that is softer by twice this percentage reaches inside the band what this one reaches above it;
spring rates scatter by 2 to 4 %."""
LONG_OPEN_DEG = 10.0
"""Cam angle [deg] over which a contact may be open. Beyond it the motion is sensitive to small changes, however small
the opening is."""


def edge_sentences(run: RunFolder) -> list[str]:
    """Warnings about a confirmed cam: too small a speed reserve, a contact that is open over a large angle, a motion
    that does not settle. Any other verdict is a stronger warning itself, so the list is then empty."""
    if run.verdict != "confirmed":
        return []
    return [*_narrow_reserve(run), *_long_open(run), *_unsettled(run)]


def _narrow_reserve(run: RunFolder) -> list[str]:
    """Warning that a limit is exceeded just above the band. It is left out where the trains as built reach the
    requested yield, because softer springs are among them."""
    if standing(run.built) in (HELD, ENOUGH):
        return []
    starts, band = run.verification.get("limits"), run.band_rpm
    if not starts or band is None:
        return []
    above = [speed for speed in starts.values() if is_number(speed) and speed > band[1]]
    reserve = 100 * (min(above) / band[1] - 1) if above else NARROW_PERCENT
    if reserve >= NARROW_PERCENT:
        return []
    return [
        f"The limits hold only {shown(reserve, 2)} % beyond the band's top speed, which a spring "
        f"{shown(2 * reserve, 2)} % softer uses up: a higher band_rpm{_yield_remedy(run)} gives a reserve."
    ]


def _long_open(run: RunFolder) -> list[str]:
    """Warning that a contact is open over more than `LONG_OPEN_DEG` while no limit of the scene forbids it."""
    angle, jump = run.verification.worst("jump_deg"), run.verification.worst("jump_mm")
    limited = "jump_max_deg" in run.demands or "contact_force_min_N" in run.demands
    if limited or angle is None or angle.value is None or angle.value <= LONG_OPEN_DEG:
        return []
    little = f" though by {shown(jump.value, 2)} mm at most" if jump is not None and is_number(jump.value) else ""
    return [
        f"A contact is open over {shown(angle.value, 3)} deg of the cam {angle.where}{little}: jump_max_deg or "
        f"contact_force_min_N in [design] would keep it closed."
    ]


def _unsettled(run: RunFolder) -> list[str]:
    """Warning that the motion does not settle at some of the verified speeds."""
    speeds = [s.get("speed_rpm") for s in run.verification.by_speed if s.get("periodic") is False]
    if not speeds:
        return []
    return [
        f"The motion at {in_words(speeds)} r/min does not settle, so that another revolution may be worse than those "
        f"that were judged: a lower jump_max_mm{_yield_remedy(run)} calms it."
    ]


def _yield_remedy(run: RunFolder) -> str:
    """The second remedy, --yield, where the scene has tolerances and the run was made without it; else empty."""
    return ", or --yield," if run.scatters and not is_number(run.built.get("wanted")) else ""


LIFT = "highest_lift_mm"
OF_THE_CAM = ("area_ratio", "area_mm_deg", LIFT)
MOTION = ("bounce_mm", "jump_mm", "jump_deg", "contact_force_min_N", "contact_force_max_N", "seating_velocity_m_per_s")
"""Metrics of the table, each with its worst value."""

FREE = ("value", "as_given", "low", "high")
"""Keys of a number in `free` of design.json."""
LEAST_GAIN = 5e-6
"""Smallest difference of area ratios that counts as a gain; a smaller one does not show in the printed digits."""


def outcome_rows(run: RunFolder) -> list[dict]:
    """One row per quantity: label, unit, value at the first step of the search ("–" where the history does not hold
    it), final value, which is the worst in verification.json, limit, speed, and source of the final value."""
    first = next((step for step in run.history if is_number(step.get("area_ratio"))), {})
    design, rows = run.demands, []
    cap = design.get("max_lift_mm")
    for key in OF_THE_CAM:
        if is_number(run.design.get(key)):
            relation = "to reach" if design.get("reach_max_lift") is True else "at most"
            limit = f"{relation} {shown(cap)}" if key == LIFT and is_number(cap) else ""
            rows.append(_row(key, first.get(key), run.design[key], limit, "", f"design.json {key}"))
    for name in MOTION:
        worst = run.verification.worst(name)
        if worst is None:
            continue
        key = name if name == "contact_force_min_N" else f"worst_{name}"  # least is worst
        limit = limit_in_words(design.get(QUANTITIES[name].limit or ""), QUANTITIES[name].less_is_worse)
        rows.append(_row(key, first.get(f"worst_{name}"), worst.value, limit, *where_and_source(worst)))
    if not (built := run.built):
        return rows
    share, low, high = (shown(100 * built[key], 3) for key in ("share", "low", "high"))
    limit = f"at least {shown(100 * built['wanted'])}" if is_number(built.get("wanted")) else ""
    row = {"label": "trains as built that hold", "unit": "%", "start": "–", "end": share, "limit": limit}
    where = f"{low} to {high} of {shown(built['trains'])} trains"
    return [*rows, row | {"where": where, "source": f"{STATED} yield.share"}]


def _row(key: str, start, end, limit: str, where: str, source: str) -> dict:
    label, unit = label_and_unit(key)
    numbers = {"start": shown(start if is_number(start) else None, 5), "end": shown(end, 5)}
    return {"label": label, "unit": unit or "–", **numbers, "limit": limit, "where": where, "source": source}


def outcome_lines(run: RunFolder) -> list[str]:
    """Lines at the end of `camopt optimize`: start and end of the search in physical units with the limits, the area
    ratios, the verdict and the warnings."""
    lines = [f"{'':<28} {'unit':<7} {'start':>12}    {'end':>12}  {'limit':<15}  where"]
    for row in outcome_rows(run):
        numbers = f"{row['label']:<28} {row['unit']:<7} {row['start']:>12} -> {row['end']:>12}"
        lines.append(f"{numbers}  {row['limit']:<15}  {row['where']}".rstrip())
    d = run.design
    words = [f"area ratio {d['area_ratio']:.5f}"] if is_number(d.get("area_ratio")) else []
    if is_number(d.get("area_ratio_bound")):
        gap = f" (gap {d['area_gap_percent']:.2f} %)" if is_number(d.get("area_gap_percent")) else ""
        words.append(f"certified bound {d['area_ratio_bound']:.5f}{gap}")
    if is_number(d.get("area_ratio_no_jump")):
        words.append(f"no-jump program {d['area_ratio_no_jump']:.5f}")
    lines += [", ".join(words)] * bool(words) + free_sentences(run) + lift_sentence(run) + gain_sentences(run)
    verdict, broken = run.verdict or "not verified", broken_words(run.broken)
    reason = run.verification.get("reason")
    why = f". {reason}" if isinstance(reason, str) and reason else ""
    verdict_line = f"verdict: {verdict}" + (f" (broken: {'; '.join(broken)})" if broken else why)
    lines += [verdict_line, *reserve(run), *edge_sentences(run)]
    built = as_built_words(run)
    return [*lines, *([f"as built: {built}"] if built else []), *yield_sentences(run)]


def reserve(run: RunFolder) -> list[str]:
    """Sentences on the speeds at which jump and bounce exceed their limits; empty where no band was swept."""
    starts = run.verification.get("limits")
    if not run.verification.get("band") or not starts or run.band_rpm is None:
        return []  # null then means that no speed was computed, not that none exceeds a limit
    return reserve_sentences(starts, run.demands, run.band_rpm)


def lift_sentence(run: RunFolder) -> list[str]:
    """States that the highest lift stays below the scene's limit, and how to change that; empty where it is reached."""
    if (below := run.below_max_lift_mm) is None:
        return []
    return [
        f"The highest lift of {shown(run.design[LIFT], 5)} mm stays {shown(below, 3)} mm below max_lift_mm: under the "
        f"scene's limits a higher nose would leave less area. reach_max_lift = true asks for the whole lift."
    ]


def free_sentences(run: RunFolder) -> list[str]:
    """A sentence for each free number of the scene: its range, the chosen value and the scene's value."""
    chosen, sentences = run.design.get("free"), []
    for name, number in chosen.items() if isinstance(chosen, dict) else ():
        if not isinstance(number, dict) or not all(is_number(number.get(key)) for key in FREE):
            continue
        value, before, low, high = (shown(number[key], 5) for key in FREE)
        label = name if number.get("of") in (name, None) else f"{name} ({number['of']})"
        end = ", an end of this range" if value in (low, high) else ""
        sentences.append(f"Of {label} from {low} to {high} the design chose {value}{end}; the scene had {before}.")
    return sentences


def gain_sentences(run: RunFolder) -> list[str]:
    """The reason why a family's cam was delivered, or the gain of area ratio over the no-jump program's cam and whether
    the verdict rejected larger cams."""
    d, sentences = run.design, []
    if isinstance(d.get("why_a_family"), str):
        return [d["why_a_family"]]
    gain = d.get("gradient_gain")
    if is_number(gain) and run.settings.get("gradient") != "none":
        if abs(gain) < LEAST_GAIN:
            tried = len(run.history)
            sentences.append(
                f"The search judged {shown(tried)} cam{'s' * (tried != 1)}, none of them both larger than the no-jump "
                f"program's and within the limits on the motion; others were not tried."
            )
        elif gain > 0:
            sentences.append(f"Adapting the margins to the judged motion gained {shown(gain, 3)} of area ratio.")
        else:
            sentences.append(f"The delivered cam has {shown(-gain, 3)} less area ratio than the no-jump program's cam.")
    back = d.get("verdict_fell_back")
    back = back if isinstance(back, dict) else {}
    judged, rejected = back.get("candidates_judged"), back.get("largest_refused_area_ratio")
    if is_number(rejected) and is_number(judged):
        largest = f"an area ratio of {shown(rejected, 5)}"
        if run.verdict == "confirmed":
            outcome = f"the last of them is delivered; the largest that was rejected has {largest}"
        else:
            why = f", because they break limits such as {broken[0]}" if (broken := broken_words(run.broken)) else ""
            outcome = f"all were rejected{why}; the largest has {largest}"
        sentences.append(f"The {shown(judged)} largest cams of the search were verified, and {outcome}.")
    return sentences


def yield_records(run: RunFolder) -> dict[str, dict]:
    """Yield statements by cam, the design first; empty where the run has none."""
    baselines = run.built.get("baselines")
    cams = {"design": run.built, **(baselines if isinstance(baselines, dict) else {})}
    return {name: record for name, record in cams.items() if isinstance(record, dict) and standing(record)}


def as_built_words(run: RunFolder) -> str:
    """One line on whether the cam holds its limits in trains as built; empty where the scene is not known."""
    built = run.built
    if built:
        return f"{share_sentence(built)}; {asked_sentence(built)}"
    if not run.scene:
        return ""
    if run.scatters:
        return "not known: this run states no yield"
    return "not known: the scene does not say how trains differ ([[tolerance]], [grinding])"


def yield_sentences(run: RunFolder) -> list[str]:
    """Lines on the causes of failing trains, the yield of each baseline, and the trains that independent methods
    judged."""
    built = run.built
    if not built:
        return []
    lines = [*spoiling_sentences(built), *filter(None, (ideal_sentence(built), advised_sentence(built)))]
    lines += [f"trains as built, {cam}: {share_sentence(record)}" for cam, record in [*yield_records(run).items()][1:]]
    sample = built.get("independent")
    if isinstance(sample, list) and sample:
        lines.append(f"independent methods judged {len(sample)} of the trains")
    return lines


def contact_sentence(run: RunFolder) -> list[str]:
    """A sentence on whether and how far the contacts between cam and valve open; empty where nothing was verified."""
    jump, angle, force = (run.verification.worst(name) for name in ("jump_mm", "jump_deg", "contact_force_min_N"))
    if jump is None or angle is None or force is None or angle.value is None or force.value is None:
        return []
    if not angle.value and force.value > 0:
        return [f"No contact between cam and valve opens: its least force is {shown(force.value)} N, {force.where}."]
    duration = run.demands.get("duration_deg")
    of = f" of the event's {shown(duration)}" if is_number(duration) else ""
    return [
        f"A contact between cam and valve opens: jump {shown(jump.value)} mm, {jump.where}; open over "
        f"{shown(angle.value)}{of} deg, {angle.where}; least contact force {shown(force.value)} N, {force.where}."
    ]


def broken_words(broken: dict[str, list[str]]) -> list[str]:
    """Labels of broken limits, each once with all its speeds, such as `bounce at 6000 and 7000 r/min`."""
    lines = []
    for key, places in broken.items():
        listed = list(dict.fromkeys(place.removesuffix(" r/min") for place in places if place))
        label = next((q.label for q in QUANTITIES.values() if q.limit == key), label_and_unit(key)[0])
        lines.append(f"{label} at {in_words(listed)} r/min" if listed else label)
    return lines
