"""Array types that state their shape, as in `Float[np.ndarray, "k n"]`: for the reader, and checked in the tests.

They are jaxtyping's where jaxtyping is loaded: in the tests, whose import hook checks every call with beartype, and
wherever JAX is at work; elsewhere, where no command waits for jaxtyping, they are the array type alone. The first axis'
name has a space before it where linters would take it for a variable, as in " n".
"""

import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Float as Float
else:

    class Float:
        """Stands in for jaxtyping's type of the same name."""

        def __class_getitem__(cls, item: tuple):
            return item[0]


State = Float[np.ndarray, " two_n"]
"""A state of n masses: their positions [m], then their velocities [m/s]."""
