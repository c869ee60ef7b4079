"""The exact gradient: traced motions, their metrics with cotangents, and the sweep back over a trace.

A cotangent of a quantity is the derivative of the final number by that quantity; the sweep carries cotangents from the
end of a motion back to its start.
"""
