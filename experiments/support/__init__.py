"""Shared parts of the experiments: records with their provenance, random scenes, fixed problems, and figures."""
