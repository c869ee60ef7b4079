"""What the user describes: scene files, their checks, the valve train as SI arrays, and the declared quantities.

Writing a scene
===============

A scene is a TOML file; `camopt scenes` lists the built-in ones and `camopt scenes kodama > mine.toml` prints one to
edit. Every fault is reported at once, with its key: unknown keys, missing parts, wrong types, NaN, negative masses,
duplicate or dangling names. A unit always stands in the key.

- The valve axis is the only axis: coordinates are positive in the opening direction and zero in the installed
  position, so reduce masses and stiffnesses that move with a rocker to the valve first.
- `[[mass]]`: `name`, `mass_kg`; to ground `damping_N_s_per_m`; a constant `force_N` where only that holds a mass.
- `[[element]]`: `name`, `kind`, `between = [a, b]` (a mass or "ground"), `stiffness_N_per_m`, `damping_N_s_per_m`,
  `preload_N`, `gap_mm`. It is compressed by d = x_a - x_b + (the lift, where `cam_driven = true`) - gap; "spring" acts
  both ways, "contact" only pushes. So the cam pushes the valve in a contact between ["ground", "valve"] with
  `cam_driven = true`; a valve spring stands between ["valve", "ground"]; the seat is a contact between
  ["ground", "valve"] whose preload is the force that holds the valve on it.
- Other laws than linear: `law = "hertz"` with `exponent`, `law = "hunt-crossley"` with `dissipation_s_per_m` beside it,
  `law = "progressive"` with a `stiffness_table`, or `law = "table"` with a `force_table`, rows of [compression_mm,
  force_N] as they are measured, and `installed_mm`, the compression with the valve closed, where they count from the
  free length.
- `kind = "adjuster"`, a hydraulic lash adjuster in the middle of its stroke: `stiffness_N_per_m` of the oil,
  `leak_N_s_per_m`, `spring_N_per_m` and `preload_N` of the plunger spring, `stroke_mm`, `check_travel_mm`.
- `kind = "friction"`, which sticks and slides: `slip_N` and the `stiffness_N_per_m` of sticking.
- `[[force]]` adds a force `on` a mass by a `table` of [cam_angle_deg, force_N] from -180 to 180; docs/model.md says
  what these three do.
- `valve` and `seat` at the top name the mass and the contact that bounce is about. `gap_mm` between cam and valve is
  the lash, which the ramp has to cover.
- `[operation]`: listed speeds and band in crankshaft r/min; `cam_per_crank` is 0.5 for a four-stroke engine, 1 where
  the speeds are camshaft speeds.
- `[design]`: duration (cam degrees between the ramp tops), maximum lift, ramps, limits; a limit left out limits
  nothing. `[geometry]` (optional): the follower (flat, roller, finger or rocker, with its pivot and arms) and the base
  circle, for curvature, contour, Hertz stress and oil film.
- `[[tolerance]]` (optional) says how a number scatters from train to train, for `camopt yield`: `of` is NAME.KEY of a
  mass or an element ("*" as NAME: each whose number is not zero, with its own draw; an array: one draw moves them
  together), `relative` or `plus_minus` (in the key's unit) how far, `distribution` how: "normal" (a standard deviation,
  cut off at four), "lognormal" (that of the logarithm) or "uniform" (half the width). `[grinding]` gives the error of a
  ground cam: `error_um` and the `harmonics` in it. All other commands take train and cam as given.
- What the source does not give belongs in `assumed = [...]` of its table, and what it gives in `source`: `verify` does
  not mind, your readers do.

What is unusual but runs, as a mass of 125 kg or a lash above the ramps, is noted and not refused:
`camopt.scene.notes.scene_notes(scene)` gives the sentences, and every command prints them on standard error.
`camopt.scene.usual` holds the ranges, with the units that are mixed up most.

At rest on the base circle every mass must be held; a scene where that fails is refused with a sentence. A valve that
hardly presses on its seat there, or not with the seat's own preload, is noted. `camopt modes mine.toml` is a good first
look: natural frequencies far from those measured mean a wrong mass or stiffness. Then `camopt simulate`,
`camopt verify` and `camopt optimize`.
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
