"""Cams: the polynomial pieces of a lift law, ramps, lift tables, and the cam families of the literature."""

from camopt.cam.lift import Lift as Lift
