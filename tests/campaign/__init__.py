"""The campaign against faults: hostile inputs, kills and starvation, drawn from seeds.

The test line runs a small size of each part; `python -m tests.campaign PART --cases N` runs as many as you like and
prints a table of classes and counts.
"""
