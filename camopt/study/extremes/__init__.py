"""`camopt extremes`: every method on extreme scenes, each answer classified against a reference."""
