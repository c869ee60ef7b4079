"""Cam families, one file each, with the equations of their authors and differentiable in their free parameters."""
