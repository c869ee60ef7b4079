"""Margins of the no-jump program moved by optax along gradients of the metrics, before the free steps of `gradient`.

Every iterate is the optimum of a linear program, so all limits on the cam's shape hold exactly. The area's slope by the
margins is the program's dual; a metric's slope is its gradient by z times the program's own slope dz / d margins
at its active rows. Shares of limits enter by a barrier, so that gradients are only taken where contacts barely part; a
cam that the judge refuses sends the search back to the best one with half the step.
"""

import jax.numpy as jnp
import numpy as np
import optax

from camopt.optimizer.program.no_jump import Margins, NoCamHoldsContact, NoJumpOptimum, NoJumpProgram
from camopt.optimizer.search.judge import USABLE_SHARE
from camopt.optimizer.search.no_jump_stage import Search
from camopt.optimizer.search.sensitivity import Sensitivity

FIRST_STEP_N = 4.0
"""Adam's first step on a margin: a fifth of the first step of the common margin."""
BARRIER = 2e-5
"""Area ratio that one e-fold of the room left under a limit is worth: a tenth of what the stage may gain."""
USED = 0.3
"""Share of a limit from which its slope is taken."""


def margin_stage(search: Search, program: NoJumpProgram, sensitivity: Sensitivity, steps: int) -> None:
    """Improve `search.best` by at most `steps` steps of Adam on the margins (3 kinds by speeds) of `program`."""
    assert search.best is not None and search.best_judged is not None, "the no-jump stage comes first"
    best, scale = search.best, 1.0
    margins = jnp.asarray(best.margins)
    adam = optax.adam(FIRST_STEP_N, b1=0.5, b2=0.9)
    state = adam.init(margins)
    slope = loss_slope(best, search, sensitivity)
    for _ in range(steps):
        update, state = adam.update(jnp.asarray(slope), state)
        moved = optax.apply_updates(margins, scale * jnp.asarray(update))
        try:
            found = program.solve(Margins(*np.asarray(moved)))
        except NoCamHoldsContact:
            scale *= 0.5
            continue
        search.consider("margins by gradient", found, briefly=True)
        if search.best is best:
            scale *= 0.5
            continue
        best, margins = found, moved
        slope = loss_slope(best, search, sensitivity)


def loss_slope(best: NoJumpOptimum, search: Search, sensitivity: Sensitivity) -> np.ndarray:
    """d (barrier - area ratio) / d margins [1/N] at the best cam, shape (3, speeds)."""
    judged = search.best_judged
    assert judged is not None
    largest = judged.share.max(axis=0)
    rows = np.argsort(-largest)[: sensitivity.width]
    rows = rows[largest[rows] > USED]
    if len(rows) == 0:
        return -best.margin_prices
    _, gradients = sensitivity(best.z, judged, rows)  # (r, l, m)
    room = np.maximum(USABLE_SHARE - judged.share[:, rows].T, 0.01)
    weight = np.where(judged.share[:, rows].T > USED, BARRIER / room, 0.0) * judged.share_slopes
    by_z = np.einsum("rl,rlm->m", weight, np.nan_to_num(gradients))
    return np.einsum("m,mks->ks", by_z, best.jacobian()) - best.margin_prices
