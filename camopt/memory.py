"""Memory of freed arrays, which goes back to the system at once where the C library is glibc."""

import ctypes
import sys
from functools import cache

MALLOPT = {"M_TRIM_THRESHOLD": (-1, 1 << 26), "M_MMAP_THRESHOLD": (-3, 1 << 22)}
"""Parameters of glibc's mallopt(3), with their numbers in <malloc.h>: free memory at the end of the heap is given back
from 64 MiB on, and arrays from 4 MiB on have pages of their own, which go with them. By itself glibc keeps freed arrays
of up to 32 MiB in one heap for each of the threads: a third of the memory of `kodama`, more where laws are curved."""
ONE_HEAP = (-8, 1)
"""M_ARENA_MAX: all threads share one heap."""


@cache
def give_memory_back(one_heap: bool = False) -> None:
    """Sets MALLOPT for the process, and with `one_heap` lets its threads share a heap, which slows a program whose
    threads allocate all the time: for processes of camopt's own."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for number, value in (*MALLOPT.values(), *([ONE_HEAP] if one_heap else [])):
            mallopt(number, value)


def trim_heaps() -> None:
    """Gives the free pages between arrays in use back to the system (glibc's malloc_trim(3))."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
