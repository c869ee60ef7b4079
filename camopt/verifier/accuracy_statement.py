"""What a verdict was asked for and what it delivered: the accuracy of bounce, in numbers and in words."""

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from camopt.scene.units import MM, UM
from camopt.verifier.at_speed import ALONE, SpeedVerdict
from camopt.verifier.convergence import FINEST, Converged


class AtSpeed(Protocol):
    """A speed of a verdict."""

    @property
    def speed_rpm(self) -> float: ...
    @property
    def bounce_range_mm(self) -> tuple[float, float]: ...
    @property
    def methods(self) -> dict[str, Converged]: ...


def bounce_error_um(speed: AtSpeed) -> float:
    """Estimated error of the bounce [um] at one speed, by the first method.

    It is the error that the last halvings of the step show. An aperiodic motion has a range of bounces, whose width is
    added. The error is infinite where there is no figure, because the valve does not seat.
    """
    first = next(iter(speed.methods.values()))
    error = first.doubt("bounce_mm")
    return float(error * MM / UM) if np.isfinite(error) else np.inf


def stated(speeds: Iterable[AtSpeed], asked_um: float, asked: str | float | None) -> dict:
    """What verification.json says under "accuracy".

    `asked_um` is the tolerance that was asked for, and `asked` the name or number by which it was asked, None where
    there was none. The accuracy counts as reached where the error is within the tolerance at every speed.
    """
    every = {s.speed_rpm: s for s in speeds}
    errors = {rpm: bounce_error_um(s) for rpm, s in every.items()}
    delivered = max(errors.values(), default=np.inf)
    words = f"accuracy asked: {asked_um:g} um" + (f" ({asked})" if isinstance(asked, str) else "")
    if delivered <= asked_um:
        finest = delivered <= FINEST["bounce_mm"] * MM / UM * (1 + 1e-9)
        words += f"; estimated error of bounce: {'at most ' if finest else ''}{delivered:.2g} um"
    else:
        none = [rpm for rpm, s in every.items() if not np.isfinite(s.bounce_range_mm).all()]
        ranges = [_range(s) for rpm, s in every.items() if errors[rpm] > asked_um and rpm not in none]
        words += f"; not reached: bounce is known to a range only, {', '.join(ranges)}" if ranges else ""
        at = ", ".join(f"{rpm:g}" for rpm in none)
        words += f"; there is no bounce at {at} r/min, where the valve does not seat" if none else ""
    return {
        "asked": asked_um if asked is None else asked,
        "asked_um": asked_um,
        "delivered_um": delivered if np.isfinite(delivered) else None,
        "reached": bool(delivered <= asked_um),
        "statement": words,
    }


def who_looked(verdicts: Iterable[SpeedVerdict]) -> str:
    """At which speeds [r/min] all methods looked, for the end of the statement; empty where they did at every one."""
    every = {v.speed_rpm: v.decided_after == ALONE for v in verdicts}
    looked = ", ".join(f"{rpm:g}" for rpm in sorted(every) if not every[rpm])
    others = sum(every.values())
    if not others:
        return ""
    return f"; all methods looked at {looked} r/min, event-exact alone at {others} other speed{'s' * (others > 1)}"


def _range(speed: AtSpeed) -> str:
    """What is known of the bounce at one speed: that of a periodic motion with its error, else the range."""
    low, high = speed.bounce_range_mm
    known = f"{high:.4f} mm +- {bounce_error_um(speed):.2g} um"
    periodic = next(iter(speed.methods.values())).periodic
    return f"{known if periodic else f'{low:.4f} to {high:.4f} mm'} at {speed.speed_rpm:g} r/min"
