"""What JAX can differentiate: rules for event-exact and smooth motions, and every cam family as a JAX function.

Importing `camopt.smooth` first turns on 64-bit floats in JAX, for all that stands here.
"""

import camopt.smooth  # noqa: F401  (64-bit floats and the cache of compiled programs are set there, once)
