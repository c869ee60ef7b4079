"""The exact gradient: traced motions, their metrics with cotangents, and the backward sweep over a trace.

A cotangent of a quantity is the derivative of the final number with respect to that quantity; the sweep propagates
cotangents from the end of a motion back to its start.
"""
