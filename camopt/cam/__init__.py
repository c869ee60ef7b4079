"""Cams: the polynomial pieces every stage reads, ramps, tables, and the families of the literature."""

from camopt.cam.lift import Lift as Lift
