"""What a report states of a run's verification: the worst figures, the judged speeds, the error of bounce."""

from camopt.report.folder import RunFolder
from camopt.scene.quantities import is_number
from camopt.scene.units import MM, UM
from camopt.verifier.convergence import FINEST
from camopt.verifier.worst import JUDGED, Worst, worst_in


def worst_of(run: RunFolder, name: str) -> Worst | None:
    """`worst_in` of a run."""
    return worst_in(run.verification, name)


def judged_speeds(verification: dict) -> list[dict]:
    """The records of all speeds that every method looked at, each speed once, ascending."""
    found = {s.get("speed_rpm"): s for key in reversed(JUDGED) for s in verification.get(key) or []}
    return sorted(found.values(), key=lambda s: s["speed_rpm"] if is_number(s.get("speed_rpm")) else 0.0)


def bounce_error_um(speed: dict) -> float | None:
    """The estimated error of bounce at a speed [um], None where there is none; never less than a verdict states."""
    error = speed.get("bounce_error_mm")
    return max(error, FINEST["bounce_mm"]) * MM / UM if is_number(error) else None
