"""Gradient ascent on a cam, from any start and with any optax transformation: objective, variables and history."""
