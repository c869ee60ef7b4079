"""Cam families: one file each, the equations of its author, differentiable in its free parameters."""
