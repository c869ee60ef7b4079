"""The search for a cam that a wanted share of the trains as built holds, and the statement of the yield it reaches."""
