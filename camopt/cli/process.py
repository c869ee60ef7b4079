"""How the process of a command uses memory: it makes objects and arrays for seconds or minutes, and then it ends."""

import ctypes
import gc
import sys

OBJECTS, YOUNG, MIDDLE = 20_000, 20, 100
"""How many objects are made between two searches for cycles of them, and how many searches among the younger ones make
one among the older. With Python's own 700, 10 and 10 a draft of `kodama` spends a thirtieth of its processor time so,
mostly while it imports what then stays."""
MALLOPT = {"M_TRIM_THRESHOLD": (-1, 1 << 26), "M_MMAP_THRESHOLD": (-3, 1 << 22), "M_ARENA_MAX": (-8, 1)}
"""Parameters of glibc's mallopt(3), with their numbers in <malloc.h>: free memory at the end of the heap is given back
from 64 MiB on, arrays from 4 MiB on have pages of their own, which go with them, and threads share one heap. By itself
glibc keeps freed arrays of up to 32 MiB in one heap for each of the threads: a third of the memory of `kodama`. With
pages of their own from 1 MiB on its search takes 70 MB less, and a second more to have them cleared."""


def prepare_process() -> None:
    """Searches for cycles of objects less often and, where the C library is glibc, gives memory back that is free."""
    gc.set_threshold(OBJECTS, YOUNG, MIDDLE)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for number, value in MALLOPT.values():
            mallopt(number, value)
