"""Return of freed memory to the operating system, where the C library is glibc."""

import ctypes
import sys
from functools import cache

MALLOPT = {"M_TRIM_THRESHOLD": (-1, 1 << 26), "M_MMAP_THRESHOLD": (-3, 1 << 22)}
"""Parameters of glibc's mallopt(3), with their numbers in <malloc.h>: free memory at the end of the heap is returned to
the system from 64 MiB on, and arrays from 4 MiB on have pages of their own, which are returned with them. By default
glibc keeps freed arrays of up to 32 MiB in one heap per thread: a third of the memory of `kodama`, or more."""
ONE_HEAP = (-8, 1)
"""M_ARENA_MAX: all threads share one heap."""


@cache
def give_memory_back(one_heap: bool = False) -> None:
    """Sets MALLOPT for the process. With `one_heap` its threads also share one heap, which slows a program whose
    threads allocate continually; it is meant for processes that belong to camopt."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for number, value in (*MALLOPT.values(), *([ONE_HEAP] if one_heap else [])):
            mallopt(number, value)


def trim_heaps() -> None:
    """Returns free pages between arrays in use to the system (glibc's malloc_trim(3))."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
