"""Event-exact motion (numba, no JAX): the reference solution for the motion of valve trains."""

from camopt.exact.affine.lines import with_chords as with_chords
from camopt.exact.engine import prepare as prepare
from camopt.exact.settled import settled_metrics as settled_metrics
