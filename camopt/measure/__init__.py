"""Settling, metrics, limits and sweeps over speed, for the recorded motion of any method (NumPy).

The optimiser's search and the verifier both evaluate motions by these files, so that an error of a metric would be
common to them. `tests/measure` therefore computes every metric a second time, from a raw motion and by its own
formulas. The methods that compute the motions share nothing with each other (`camopt.verifier.methods`).
"""
