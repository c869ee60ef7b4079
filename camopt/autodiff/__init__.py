"""What JAX can differentiate: rules for event-exact and smooth motions, and every cam family as a JAX function.

This package imports `camopt.smooth` first, which turns on 64-bit floats in JAX for everything that stands here.
"""

import camopt.smooth  # noqa: F401  (64-bit floats and the cache of compiled programs are set there, once)
