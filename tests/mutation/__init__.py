"""Mutation testing: random faults are put into the sources one at a time, and tests have to detect them."""
