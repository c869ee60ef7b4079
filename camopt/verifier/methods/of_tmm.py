"""Matrix of one step of a train on one set of pieces, by the Taylor series as printed or by the exact exponential."""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm


class Memories(NamedTuple):
    """The memories z (r) of one set of pieces: z' = by_position x - decay z + constant + by_lift lift."""

    by_memory: np.ndarray  # (n, r) N/m: forces on the masses per memory
    by_position: np.ndarray  # (r, n) 1/s
    decay: np.ndarray  # (r) 1/s
    constant: np.ndarray  # (r) m/s
    by_lift: np.ndarray  # (r) 1/s


def printed(inverse_mass, damping, stiffness, h: float, memories: Memories) -> np.ndarray:
    """Eq. (14): (x, v, z) after a step from (x, v, z, F, F', F'', G, G', G''), shape (2n + r, 5n + 4r).

    F are the forces on the masses, and G is the remaining term of the memories, z' = by_position x - decay z + G.
    """
    n, r = memories.by_memory.shape
    x, v, z, *inputs = np.split(np.eye(5 * n + 4 * r), np.cumsum([n, n, r, n, n, n, r, r]))
    derivatives, of_memory = [x, v], [z]
    for force, moved in zip(inputs[:3], inputs[3:], strict=True):
        resisting = force - damping @ derivatives[-1] - stiffness @ derivatives[-2]
        derivatives.append(inverse_mass @ (resisting + memories.by_memory @ of_memory[-1]))
        of_memory.append(memories.by_position @ derivatives[-3] - memories.decay[:, None] * of_memory[-1] + moved)
    series = [h**j / math.factorial(j) for j in range(5)]
    position = sum(s * d for s, d in zip(series, derivatives, strict=True))
    velocity = sum(s * d for s, d in zip(series[:4], derivatives[1:], strict=True))
    memory = sum(s * d for s, d in zip(series[:4], of_memory, strict=True))
    return np.concatenate([position, velocity, memory])


def exact(inverse_mass, damping, stiffness, h: float, memories: Memories) -> np.ndarray:
    """Like `printed`, but exact if F and G are quadratic in time."""
    n, r = memories.by_memory.shape
    size = 2 * n + r
    system = np.zeros((5 * n + 4 * r, 5 * n + 4 * r))
    system[:n, n : 2 * n] = np.eye(n)
    pulls = -inverse_mass @ stiffness, -inverse_mass @ damping, inverse_mass @ memories.by_memory, inverse_mass
    system[n : 2 * n, : size + n] = np.hstack(pulls)
    system[2 * n : size, :n] = memories.by_position
    system[2 * n : size, 2 * n : size] = -np.diag(memories.decay)
    system[2 * n : size, size + 3 * n : size + 3 * n + r] = np.eye(r)
    for begin, width in ((size, n), (size + 3 * n, r)):
        system[begin : begin + 2 * width, begin + width : begin + 3 * width] = np.eye(2 * width)
    return expm(h * system)[:size]
