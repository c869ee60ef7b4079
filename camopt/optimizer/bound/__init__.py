"""Certified upper bounds on the area, from the multipliers of a fine linear program alone."""
