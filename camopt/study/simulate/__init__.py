"""`camopt.simulate`: one motion from rest by any method, at a step or at an accuracy."""
