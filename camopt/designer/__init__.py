"""The live designer: `session` answers from the numbers of an edited scene while a limit is dragged; `server` brings it
to a browser on this machine and `widget` into a notebook (`camopt.live`, with the extra `interactive`), both with the
one ES module in `page`."""

from pathlib import Path
from typing import TYPE_CHECKING

from camopt.scene import InputError, Scene
from camopt.scene.schema import SIMULATED

if TYPE_CHECKING:
    from camopt.designer.widget import LiveWidget


def live(scene: Scene, *, folder: Path | str | None = None) -> "LiveWidget":
    """The live designer of a scene as a widget for Jupyter, VS Code or marimo; its `value` is the cam (a Lift).

    Limits, duration, lift, ramps, spring, lash and tolerances are sliders; the page answers while they are dragged, as
    `camopt design` does in a browser. The widget's `scene` is the scene with the page's numbers, for `camopt.verify`
    and `camopt.optimize`. With a `folder`, made where there is none, the widget verifies too, and saves scenes and run
    folders there and nowhere else; its `verification` is then what the last verdict on the page's numbers found. Raises
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
