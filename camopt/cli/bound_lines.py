"""What `camopt bound` prints: the area ratios that a scene allows, and what more of each limit would buy."""

LEAST_WORTH = 5e-5
"""Per cent of area that would show as zero."""


def bound_lines(found: dict) -> list[str]:
    """The content of `bound --json` in sentences and a table, with units and as many digits as can matter."""
    lines = [
        "area ratio: the lift's integral over the duration, by max_lift_mm times duration_deg",
        _row("no cam has more (certified)", found["area_ratio_bound"]),
        _row("a cam within the limits on the shape has", found["area_ratio_feasible"]),
    ]
    if found["bound_leaves_out"]:
        left_out = ", ".join(found["bound_leaves_out"])
        lines.append(f"  the bound ignores {left_out}, so that the true maximum may be lower")
    speeds = ", ".join(f"{speed:g}" for speed in found["speeds_rpm"])
    force, seat = found["margins_N"], found["seat_margin_N"]
    apart = "" if seat == force else f", and the seat by {seat:g} N,"
    lines.append(f"with contacts closed by {force:g} N or more{apart} at {speeds} r/min, by the linear model:")
    if found["area_ratio_no_jump_bound"] is not None:
        lines.append(_row("no cam has more", found["area_ratio_no_jump_bound"]))
    if found["area_ratio_no_jump"] is not None:
        lines.append(_row("a cam has", found["area_ratio_no_jump"]))
    if found["no_jump_says"]:
        lines.append(f"  {found['no_jump_says']}")
    worth = {name: value for name, value in found["worth_percent"].items() if abs(value) >= LEAST_WORTH}
    if worth:
        lines.append("1 % more of a limit on the shape buys, in per cent of area:")
        width = max(map(len, worth))
        lines += [f"  {name:<{width}} {value:8.4f} %" for name, value in worth.items()]
    free = [name for name in found["worth_percent"] if name not in worth]
    return lines + [f"  nothing: {', '.join(free)}"] * bool(free)


def _row(label: str, ratio: float) -> str:
    return f"  {label:<42} {ratio:.5f}"
