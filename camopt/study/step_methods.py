"""The methods that the extremes are put to, by name; compiled on demand."""

from functools import partial

from camopt import exact
from camopt.verify import dop853, houbolt, rkg, tmm
from camopt.verify.converge import Prepare

STEP_METHODS: dict[str, Prepare] = {
    "rkg": rkg.prepare,
    "tmm": tmm.prepare,
    "tmm-exponential": partial(tmm.prepare, exponential=True),
    "houbolt": houbolt.prepare,
    "houbolt-explicit": partial(houbolt.prepare, explicit=True),
}
"""Methods of fixed steps that locate no switching."""
LOCATING: dict[str, Prepare] = {"event": exact.prepare, "dop853": dop853.prepare}
"""Methods that locate every switching."""
