"""Metrics of the settled motion from train, cam and speed, in one compiled path."""

from camopt.exact.settled.many import ERRORS as ERRORS
from camopt.exact.settled.many import settled_metrics as settled_metrics
