"""Simulation of the train of a run folder by Exudyn, an engine developed independently of camopt.

The package reads only `scene.toml` and `design.json`, and imports nothing else of camopt. It has its own code for
reading the files, for the laws of force, for the state at rest and for the metrics; Exudyn integrates the motion.
Agreement with it therefore confirms camopt's interpretation of the scene file. It runs in a separate process:

    python -m camopt.verifier.outside SCENE.toml DESIGN.json --speeds 5000 6000 --out motion.json

`camopt verify --outside` and `experiments.outside_judges` start this process and compare its motion with camopt's.
"""
