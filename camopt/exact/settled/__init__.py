"""One compiled path from train, cam and speed to the metrics of the settled motion."""

from camopt.exact.settled.many import ERRORS as ERRORS
from camopt.exact.settled.many import settled_metrics as settled_metrics
