"""Exact factors between the field's units (at the edges) and SI and radians (inside)."""

import math

MM = 1e-3
"""Metres in a millimetre."""
UM = 1e-6
"""Metres in a micrometre."""
DEG = math.pi / 180.0
"""Radians in a degree."""
MM_PER_DEG = MM / DEG
"""Velocity by cam angle, m/rad in a mm/deg."""
MM_PER_DEG2 = MM / DEG**2
"""Acceleration by cam angle, m/rad^2 in a mm/deg^2."""
MM_PER_DEG3 = MM / DEG**3
"""Jerk by cam angle, m/rad^3 in a mm/deg^3."""
MM_PER_DEG4 = MM / DEG**4
"""Snap by cam angle, m/rad^4 in a mm/deg^4."""
RPM = 2.0 * math.pi / 60.0
"""rad/s in a revolution per minute."""
