"""A judge from outside: the motion of a run folder's train by Exudyn, an engine that nobody here wrote.

The package reads `scene.toml` and `design.json` alone, and imports nothing of camopt beside itself. It reads the files,
writes the laws of force, finds the state at rest and reads the figures with code of its own; Exudyn integrates. So
whatever agrees with it agrees with a second understanding of the scene file. It runs in a process of its own:

    python -m camopt.verifier.outside SCENE.toml DESIGN.json --speeds 5000 6000 --out motion.json

`camopt verify --outside` and `experiments.outside_judges` do that, and compare what comes back with camopt's motion.
"""
