"""The ball of `gradient_ball` in NVIDIA Warp: camopt's law in a kernel of its own, and Warp's tape backwards."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from experiments.support.gradient_ball import AT, END, Answer


def warp_kernel(steps: int) -> Callable[[], Answer]:
    """Semi-implicit Euler steps, a launch each, in double precision on the processor; a pass backwards for position and
    speed each."""
    wp: Any = import_module("warp")
    wp.config.quiet = True
    array, real = wp.array(dtype=wp.float64), wp.float64

    @wp.kernel
    def begin(numbers: array, x: array, v: array):  # pyright: ignore[reportInvalidTypeForm]  # Warp's own types
        x[0] = numbers[1]
        v[0] = -numbers[0]

    @wp.kernel
    def advance(numbers: array, x: array, v: array, i: int, h: real):  # pyright: ignore[reportInvalidTypeForm]
        force = real(0.0)
        if x[i] < real(0.0):
            force = wp.max(-numbers[3] * x[i] - numbers[2] * v[i], real(0.0))
        after = v[i] + h * force
        v[i + 1] = after
        x[i + 1] = x[i] + h * after

    def answer() -> Answer:
        numbers, x, v = (
            wp.array(values, dtype=wp.float64, device="cpu", requires_grad=True)
            for values in (AT, np.zeros(steps + 1), np.zeros(steps + 1))
        )
        tape = wp.Tape()
        with tape:
            wp.launch(begin, dim=1, inputs=[numbers, x, v], device="cpu")
            for i in range(steps):
                wp.launch(advance, dim=1, inputs=[numbers, x, v, i, END / steps], device="cpu")
        rows, last = [], np.zeros(steps + 1)
        last[-1] = 1.0
        for end in (x, v):
            tape.zero()
            tape.backward(grads={end: wp.array(last, dtype=wp.float64, device="cpu")})
            rows.append(numbers.grad.numpy().copy())
        return np.array([x.numpy()[-1], v.numpy()[-1]]), np.stack(rows), steps

    return answer
