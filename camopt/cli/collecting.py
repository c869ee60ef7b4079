"""How often a command looks for garbage in circles of references: rarely, since it makes little of it."""

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager

RARELY = 100_000, 20, 50
"""New objects after which Python looks for garbage, and how many such looks make a longer one. Python's own 700 (2000
from 3.13 on) have it walk again and again through all that numba, SciPy and matplotlib keep to the process's end."""

atexit.register(gc.freeze)  # what is left goes with the process: nothing need walk through it once more


@contextmanager
def collecting_rarely() -> Iterator[None]:
    """Garbage is looked for rarely inside, and as often as before outside; one that never was stays off."""
    before = gc.get_threshold()
    if before[0]:
        gc.set_threshold(*RARELY)
    try:
        yield
    finally:
        gc.set_threshold(*before)
