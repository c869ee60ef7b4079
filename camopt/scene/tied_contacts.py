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

    Each such contact has that preload more, and the masses at its ends carry it as a constant force: the motion is the
    same as long as it pushes, and goes on linearly where it would part. Its force is reported with the preload. Every
    path simulates and differentiates it as it does any train. Raises InputError where such a contact's law is not
    linear, or where there is none.
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
