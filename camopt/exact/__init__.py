"""Event-exact motion (numba, no JAX): the reference against which the project measures trains with linear laws."""

from camopt.exact.engine import prepare as prepare
