"""The one list of followers, by the names that a scene's [geometry] gives them."""

from camopt.cam.followers.arm import Arm
from camopt.cam.followers.flat import Flat
from camopt.cam.followers.roller import Roller
from camopt.cam.followers.touch import Follower
from camopt.scene.geometry import Geometry

FOLLOWERS = {"flat": Flat, "roller": Roller, "finger": Arm, "rocker": Arm}


def follower_of(geometry: Geometry) -> Follower:
    """The follower that a [geometry] describes."""
    return FOLLOWERS[geometry.follower].of(geometry)
