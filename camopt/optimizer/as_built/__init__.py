"""The search for a cam with which a wanted share of the trains as built keeps its limits, and the yield's statement."""
