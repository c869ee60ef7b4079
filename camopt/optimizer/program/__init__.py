"""Linear programs for the cam: the kinematic problem, and contacts that stay closed in the linear periodic motion."""
