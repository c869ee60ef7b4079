"""Scene files and their checks, the valve train as SI arrays, and the declared metrics.

A scene is a TOML file; docs/reference/scene.md lists its tables and keys, and docs/tutorials/your-valve-train.md shows
how to write one. All coordinates lie along the valve axis: they are positive in the opening direction and zero in the
installed position, so masses and stiffnesses that move with a rocker are reduced to the valve first. All faults of a
file are reported together, each with its key. An unusual value with which a scene still runs, such as a mass of 125 kg,
causes a note and no error (`camopt.scene.notes`).
"""

from camopt.scene.errors import InputError as InputError
from camopt.scene.errors import MotionRefused as MotionRefused
from camopt.scene.load import builtin_scenes as builtin_scenes
from camopt.scene.load import load_scene as load_scene
from camopt.scene.load import parse_scene as parse_scene
from camopt.scene.load import scene_text as scene_text
from camopt.scene.quantities import QUANTITIES as QUANTITIES
from camopt.scene.response import Response as Response
from camopt.scene.rest import rest_position as rest_position
from camopt.scene.rest import state_at_rest as state_at_rest
from camopt.scene.schema import Scene as Scene
from camopt.scene.train import Train as Train
from camopt.scene.train import build_train as build_train
