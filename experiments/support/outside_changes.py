"""Ten small changes of a train, its cam or its contacts, each of which an independent engine must detect."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from camopt.cam.lift import Lift
from camopt.scene import Scene
from camopt.scene.parameters import Tied, matching, with_numbers
from camopt.scene.units import UM
from camopt.verifier.outside.forces import DAMPING_UP_TO_SPRING, MAY_PULL, NEVER_PULLS


@dataclass(frozen=True)
class Change:
    """A change of the scene, cam or contact law that the engine is given."""

    name: str
    scene: Callable[[Scene], Scene] = lambda scene: scene
    cam: Callable[[Lift], Lift] = lambda lift: lift
    law: str = NEVER_PULLS


def scaled(name: str, factor: float) -> Callable[[Scene], Scene]:
    """A function that multiplies the numbers NAME.KEY of a scene."""
    return lambda scene: Tied(name, tuple(matching(scene, name))).scaled(scene, factor)


def more_lash(scene: Scene) -> Scene:
    """The scene with a lash that is 1 um larger."""
    return with_numbers(scene, {number: number.of(scene) + 1e-3 for number in matching(scene, "*.gap_mm")})


def higher_nose(lift: Lift) -> Lift:
    """The cam with a nose that is 1 um higher."""
    return replace(lift, coefficients=lift.coefficients * (1 + UM / lift.max_lift))


CHANGES = (
    Change("seat damping 5 % more", scaled("seat.damping_N_s_per_m", 1.05)),
    Change("tip damping 5 % more", scaled("follower_valve.damping_N_s_per_m", 1.05)),
    Change("lash 1 um more", more_lash),
    Change("mass of the valve's head 0.5 % more", scaled("valve_head.mass_kg", 1.005)),
    Change("force on the follower 1 % more", scaled("follower.force_N", 1.01)),
    Change("nose 1 um higher", cam=higher_nose),
    Change("contacts whose dampers may pull", law=MAY_PULL),
    Change("contacts whose damping is at most the spring's force", law=DAMPING_UP_TO_SPRING),
    Change("seat damping 1 % more", scaled("seat.damping_N_s_per_m", 1.01)),
    Change("rate of one coil 1 % more", scaled("coil_3.stiffness_N_per_m", 1.01)),
)
"""The changes, on `kodama`. Prototypes showed that settled metrics within 1e-4 mm or 1 % do not detect the last two."""
