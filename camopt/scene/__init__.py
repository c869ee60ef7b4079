"""What the user describes: scene files, their checks, the valve train as SI arrays, and the declared quantities."""

from camopt.scene.errors import InputError as InputError
from camopt.scene.errors import MotionRefused as MotionRefused
from camopt.scene.load import builtin_scenes as builtin_scenes
from camopt.scene.load import load_scene as load_scene
from camopt.scene.load import parse_scene as parse_scene
from camopt.scene.load import scene_text as scene_text
from camopt.scene.quantities import QUANTITIES as QUANTITIES
from camopt.scene.response import Response as Response
from camopt.scene.rest import rest_position as rest_position
from camopt.scene.schema import Scene as Scene
from camopt.scene.train import Train as Train
from camopt.scene.train import build_train as build_train
