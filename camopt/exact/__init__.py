"""Event-exact motion (numba, no JAX): the reference of the project where all laws are linear."""

from camopt.exact.engine import prepare as prepare
