"""Robustness tests with random cases drawn from seeds: hostile inputs, killed processes and missing resources.

The test suite runs a small size of each part; `python -m tests.campaign PART --cases N` runs any number of cases and
prints a table of classes and counts.
"""
