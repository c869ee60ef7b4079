"""The linear programs: the kinematic problem, and contacts that stay closed under the linear periodic motion."""
