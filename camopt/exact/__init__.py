"""Event-exact motion (numba, no JAX): the reference against which the project measures trains with linear laws."""

from camopt.exact.engine import prepare as prepare
from camopt.exact.settled import SettledMetrics as SettledMetrics
from camopt.exact.settled import settled_metrics as settled_metrics
