"""The train with its contacts between cam and valve held closed: a motion that cannot jump, and its force margin."""

from dataclasses import replace
from functools import lru_cache

from camopt.scene.errors import InputError
from camopt.scene.laws import LINEAR
from camopt.scene.train import GROUND, Train

HOLDING_N = 1e5
"""Pull [N] up to which the contacts are held."""


@lru_cache(maxsize=32)
def held_closed(train: Train) -> Train:
    """The train whose contacts between cam and valve also pull, by up to `HOLDING_N`.

    Each such contact gets that much more preload, and the masses at its ends carry it as a constant force. So the
    motion is the same as long as the contact pushes, and it goes on linearly where the contact would part. The force
    that is reported includes the additional preload. Every path simulates and differentiates the new train as it does
    any other. Raises InputError where such a contact's law is not linear, or where there is no such contact.
    """
    if not train.cam_side:
        raise InputError("a contact force margin needs a contact between cam and valve: name the scene's valve")
    if train.laws is not None:
        bent = [train.element_names[e] for e in train.cam_side if train.laws.kind[e] != LINEAR]
        if bent:
            raise InputError(
                f"contacts cannot be held closed beyond a law that is not linear, as of {', '.join(bent)}: "
                f"take the least contact force itself"
            )
    preload, force = train.preload.copy(), train.mass_force.copy()
    for e in train.cam_side:
        preload[e] += HOLDING_N
        for mass, sign in ((train.a[e], 1.0), (train.b[e], -1.0)):
            if mass != GROUND:
                force[mass] += sign * HOLDING_N
    return replace(train, preload=preload, mass_force=force)
