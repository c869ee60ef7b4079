"""The smooth, differentiable path (JAX): smoothed contact, integrators, metrics and their gradients.

Importing this package turns on 64-bit floats in JAX and keeps compiled programs on disk between runs
(`camopt.smooth.compilation`).
"""

import os

import jax

from camopt.smooth.compilation import cache_compilations

# Before equinox is first imported: its error checks are host callbacks, which JAX <= 0.10 refuses to cache on disk.
os.environ.setdefault("EQX_ON_ERROR", "nan")
jax.config.update("jax_enable_x64", True)
cache_compilations()
