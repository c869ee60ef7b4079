"""The live designer: `session` computes the answers for an edited scene while the user drags a slider; `server` serves
it to a browser on this machine and `widget` shows it in a notebook (`camopt.live`, with the extra `interactive`), both
with the same ES module in `page`."""

from pathlib import Path
from typing import TYPE_CHECKING

from camopt.scene import InputError, Scene
from camopt.scene.schema import SIMULATED

if TYPE_CHECKING:
    from camopt.designer.widget import LiveWidget


def live(scene: Scene, *, folder: Path | str | None = None) -> "LiveWidget":
    """The live designer of a scene as a widget for Jupyter, VS Code or marimo; its `value` is the cam (a Lift).

    Limits, duration, lift, ramps, spring, lash and tolerances are sliders; the page is updated while they are dragged,
    as with `camopt design` in a browser. The widget's `scene` is the scene with the page's numbers, for `camopt.verify`
    and `camopt.optimize`. With a `folder`, which is created if it does not exist, the widget can also verify, and saves
    scenes and run folders only there; its `verification` is then the last verdict on the page's numbers. Raises
    InputError for a scene without valve, seat, speeds or design, and where the extra `interactive` is not installed.
    """
    missing = [name for name in SIMULATED if getattr(scene, name) is None]
    if missing:
        raise InputError(f"scene {scene.name}: live needs {', '.join(missing)}")
    try:
        from camopt.designer.widget import LiveWidget
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("camopt"):
            raise
        raise InputError(
            f"live: {error.name} is not installed: pip install 'camopt[interactive]', or `camopt design` in a browser"
        ) from error
    return LiveWidget(scene, None if folder is None else Path(folder))
