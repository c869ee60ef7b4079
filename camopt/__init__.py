"""camopt: differentiable cam design for valve trains, re-checked by an independent non-smooth verifier.

    import camopt

    scene = camopt.load_scene("kodama")             # a built-in name or a TOML file
    cam = camopt.polydyne(scene)
    print(camopt.verify(scene, cam).verdict)
    run = camopt.optimize(scene, accuracy="draft", out="runs/first")

Every name below is an attribute of `camopt` and is imported on first use; `help(camopt.simulate)` explains one.

- To begin with: `load_scene`, and `read_cam` for a cam as the command line names it: a family, a lift table, a run.
- Cams of the literature: `polydyne`, `multi_pol`, `new_design`, `exponent`, `kurz`, `trapezoid`, `cycloidal`,
  `polynomial_345`, `polynomial_4567`; from free coefficients `free_cam`; from a measured table `read_lift_table`.
- From the cam alone: `cam_card` lists the angles at which it opens and closes at any lift, with a `CrankTiming` on the
  crank and with overlap; `camshaft_torque` is the torque of a shaft of cams; `converted` is another follower's lift.
- To judge a cam: `simulate` its motion, `verify` it by independent methods, `compare` it with others.
- To design a cam: `live` updates a design in a notebook while limits are dragged, `area_bound` bounds the area that any
  cam can have, `optimize` designs the cam of largest area within the limits.
- About the train: `modes` gives its natural frequencies, `reduce` finds a smaller model, `identify` fits it to a
  `MeasuredLift`, `tradeoff` measures what accuracy costs.
- Trains as built: `trains_as_built` draws them within a scene's tolerances, `manufacturing_yield` gives the share of
  them that holds the limits with a cam.
- Gradient ascent: `objective` is the function to maximise, `ascend` maximises it from any cam by any optax
  transformation within the limits on the shape, `nearest_free_cam` gives a start.
- The programs behind the designs: `linearised` gives contact forces and gaps along a revolution with their derivatives
  with respect to cam and train, `linear_program` solves a linear program as a function that JAX differentiates.
- Many tasks: `sweep` computes them on all cores or on a cluster and keeps a row for each in a store that resumes.
- Beyond one design: `pareto` fronts, `joint_spring` for cam and spring together, `differentiable` cams for JAX.

Bad input raises `camopt.scene.InputError`, whose text states what is wrong and where, what was expected, and the
remedy. The command line offers the same verbs: `camopt --help`.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

# ruff: noqa: F401
if TYPE_CHECKING:  # for editors and type checkers, which do not run `__getattr__`
    from camopt.cam.card import CrankTiming, cam_card
    from camopt.cam.conversion import converted
    from camopt.cam.families.dwell import cycloidal, polynomial_345, polynomial_4567
    from camopt.cam.families.exponent import exponent
    from camopt.cam.families.free import free_cam
    from camopt.cam.families.kurz import kurz
    from camopt.cam.families.multi_pol import multi_pol
    from camopt.cam.families.new_design import new_design
    from camopt.cam.families.polydyne import polydyne
    from camopt.cam.families.trapezoid import trapezoid
    from camopt.cam.read import read_cam
    from camopt.cam.tables.lift_table import read_lift_table
    from camopt.designer import live
    from camopt.measure.as_built import trains_as_built
    from camopt.optimizer.ascent.ascent import ascend
    from camopt.optimizer.ascent.objective import objective
    from camopt.optimizer.ascent.projection import nearest_free_cam
    from camopt.optimizer.baselines.comparison import compare
    from camopt.optimizer.bound.summary import area_bound
    from camopt.optimizer.program.chosen_duration import load_scene
    from camopt.optimizer.program.differentiable import linear_program
    from camopt.optimizer.run import optimize
    from camopt.smooth.families import differentiable
    from camopt.study.cam_force import camshaft_torque
    from camopt.study.fronts import joint_spring, pareto
    from camopt.study.identify.identification import MeasuredLift, identify
    from camopt.study.linearised.linearised import linearised
    from camopt.study.modes import modes
    from camopt.study.reduce.reduction import reduce
    from camopt.study.simulate.motion import simulate
    from camopt.study.tradeoff.tradeoff import tradeoff
    from camopt.study.yields import manufacturing_yield
    from camopt.tasks.sweep import sweep
    from camopt.verifier.accuracy import verify

__version__ = version("camopt")

_PUBLIC = {
    "optimize": "camopt.optimizer.run",
    "verify": "camopt.verifier.accuracy",
    "load_scene": "camopt.optimizer.program.chosen_duration",
    "polydyne": "camopt.cam.families.polydyne",
    "multi_pol": "camopt.cam.families.multi_pol",
    "new_design": "camopt.cam.families.new_design",
    "exponent": "camopt.cam.families.exponent",
    "kurz": "camopt.cam.families.kurz",
    "trapezoid": "camopt.cam.families.trapezoid",
    "free_cam": "camopt.cam.families.free",
    "cycloidal": "camopt.cam.families.dwell",
    "polynomial_345": "camopt.cam.families.dwell",
    "polynomial_4567": "camopt.cam.families.dwell",
    "differentiable": "camopt.smooth.families",
    "read_cam": "camopt.cam.read",
    "read_lift_table": "camopt.cam.tables.lift_table",
    "cam_card": "camopt.cam.card",
    "CrankTiming": "camopt.cam.card",
    "converted": "camopt.cam.conversion",
    "camshaft_torque": "camopt.study.cam_force",
    "simulate": "camopt.study.simulate.motion",
    "modes": "camopt.study.modes",
    "reduce": "camopt.study.reduce.reduction",
    "tradeoff": "camopt.study.tradeoff.tradeoff",
    "area_bound": "camopt.optimizer.bound.summary",
    "compare": "camopt.optimizer.baselines.comparison",
    "identify": "camopt.study.identify.identification",
    "MeasuredLift": "camopt.study.identify.identification",
    "linearised": "camopt.study.linearised.linearised",
    "pareto": "camopt.study.fronts",
    "joint_spring": "camopt.study.fronts",
    "trains_as_built": "camopt.measure.as_built",
    "manufacturing_yield": "camopt.study.yields",
    "sweep": "camopt.tasks.sweep",
    "objective": "camopt.optimizer.ascent.objective",
    "ascend": "camopt.optimizer.ascent.ascent",
    "nearest_free_cam": "camopt.optimizer.ascent.projection",
    "linear_program": "camopt.optimizer.program.differentiable",
    "live": "camopt.designer",
}
__all__ = sorted(_PUBLIC)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str):
    """Public names are imported on first use, so that `import camopt` loads neither JAX nor numba."""
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'camopt' has no attribute {name!r}")


def __dir__():
    return [*__all__, "__version__"]
