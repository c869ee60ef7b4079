"""The exact gradient: motions kept as traces, their metrics with cotangents, and the sweep back over a trace."""
