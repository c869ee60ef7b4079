"""Array types that state their shape, as in `Float[np.ndarray, "k n"]`, for the reader and for checks in the tests.

They are jaxtyping's where jaxtyping is loaded: in the tests, whose import hook checks every call with beartype, and
wherever JAX is used. Elsewhere they are the array type alone, so that no command has to load jaxtyping. The name of a
single axis has a space before it, as in " n", because linters would take it for a variable.
"""

import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Float as Float
else:

    class Float:
        """Replaces jaxtyping's type of the same name."""

        def __class_getitem__(cls, item: tuple):
            return item[0]


State = Float[np.ndarray, " two_n"]
"""A state of n masses: their positions [m], then their velocities [m/s]."""
