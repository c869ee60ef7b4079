"""Figures from arrays: every function returns a matplotlib Figure, `save` writes it; nothing here computes a result."""

from camopt.plots.cams import profiles
from camopt.plots.motion import DrawnMotion, last_revolution, valve_motion
from camopt.plots.search import History, convergence
from camopt.plots.speeds import Sweep, bounce_against_speed
from camopt.plots.studies import modes
from camopt.plots.style import cam_line, save

__all__ = [
    "DrawnMotion",
    "History",
    "Sweep",
    "bounce_against_speed",
    "cam_line",
    "convergence",
    "last_revolution",
    "modes",
    "profiles",
    "save",
    "valve_motion",
]
