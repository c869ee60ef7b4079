"""Figures from arrays: every function returns a matplotlib Figure, and `save` writes it; no result is computed here."""

from camopt.plots.cams import DrawnMotion as DrawnMotion
from camopt.plots.cams import last_revolution as last_revolution
from camopt.plots.cams import profiles as profiles
from camopt.plots.cams import valve_motion as valve_motion
from camopt.plots.search import convergence as convergence
from camopt.plots.speeds import Sweep as Sweep
from camopt.plots.speeds import bounce_against_speed as bounce_against_speed
from camopt.plots.studies import modes as modes
from camopt.plots.style import cam_line as cam_line
from camopt.plots.style import save as save
