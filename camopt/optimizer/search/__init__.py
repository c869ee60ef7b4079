"""The search for a cam: linear programs on tied contact forces, whose margins the non-smooth judge feeds back."""
