"""The search for a cam: linear programs on tied contact forces, with margins adapted to the event-exact motion."""
