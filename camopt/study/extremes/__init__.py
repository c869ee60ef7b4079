"""`camopt extremes`: every method at the extremes, each answer classified against the truth."""
