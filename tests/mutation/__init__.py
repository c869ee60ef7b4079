"""Mutation testing: faults drawn into the sources one at a time, and whether a test notices."""
