"""Gradient ascent on a cam from any start, with any optax transformation: the objective, what varies, the history."""
