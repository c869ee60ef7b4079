"""The designer as a widget of a notebook: the module of the served page, whose messages go to the notebook's kernel."""

from pathlib import Path
from typing import Any

import anywidget

from camopt.cam.lift import Lift
from camopt.designer.requests import RequestHandler
from camopt.designer.server import module_text, style_text
from camopt.designer.session import Session
from camopt.scene import InputError, Scene


class LiveWidget(anywidget.AnyWidget):
    """The designer of one scene; `values` are the page's numbers by key, `scene` is the scene with them."""

    _esm = module_text()
    _css = style_text()

    def __init__(self, scene: Scene, folder: Path | None):
        super().__init__()
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        self.requests = RequestHandler(Session(scene), folder)
        self.values: dict[str, Any] = self.requests.session.values()
        self.on_msg(self.hear)

    @property
    def value(self) -> Lift:
        """The cam of the page's numbers; raises InputError where they allow none."""
        return self.requests.session.design(self.values).cam.lift

    @property
    def scene(self) -> Scene:
        """The scene with the page's numbers; raises InputError where they are not a valid scene."""
        return self.requests.session.design(self.values).scene

    @property
    def verification(self) -> dict[str, Any] | None:
        """verification.json of the page's numbers; None without a complete verdict on them."""
        return self.requests.verified(self.values)

    def hear(self, widget: Any, content: dict[str, Any], buffers: Any) -> None:
        """Answer a message of the page: its number is sent back with the reply, or with the sentence of an error."""
        message = content["message"]
        try:
            reply = self.requests.reply(message)
        except InputError as error:
            self.send({"number": content["number"], "says": str(error)})
            return
        if reply.get("state") == "ok" and reply.get("part") in ("sketch", "cam"):
            self.values = dict(message["values"])
        self.send({"number": content["number"], "reply": reply})

    def close(self) -> None:
        """Close the widget and end its processes."""
        self.requests.stop()
        super().close()
