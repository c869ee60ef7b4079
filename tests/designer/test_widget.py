"""The designer in a notebook: the widget's value is the cam of its numbers, and its messages are those of the page."""

import builtins

import pytest

import camopt
from camopt.designer.session import Session
from camopt.scene import InputError, load_scene

pytest.importorskip("anywidget", reason="the extra `interactive` is not installed")
SCENE = load_scene("motori-1")


@pytest.fixture
def widget(monkeypatch):
    live = camopt.live(SCENE)
    live.sent = []
    monkeypatch.setattr(live, "send", live.sent.append)
    yield live
    live.close()


def test_its_value_is_the_cam_of_the_numbers(widget):
    assert widget.value.area == Session(SCENE).design({}).cam.lift.area
    message = {"kind": "answer", "part": "cam", "values": {"max_lift_mm": 9.0}, "client": "a", "sequence": 1}
    widget.hear(widget, {"number": 3, "message": message}, [])
    (sent,) = widget.sent
    assert sent["number"] == 3 and sent["reply"]["state"] == "ok"
    assert widget.scene.design.max_lift_mm == 9.0
    assert widget.value.area_ratio_in(widget.scene.design) == pytest.approx(sent["reply"]["area_ratio"], abs=1e-12)


def test_invalid_numbers_do_not_change_the_value(widget):
    before = widget.value
    message = {"kind": "answer", "part": "cam", "values": {"max_lift_mm": -9.0}, "client": "a", "sequence": 1}
    widget.hear(widget, {"number": 1, "message": message}, [])
    assert widget.sent[0]["reply"]["faults"] and widget.value.area == before.area


def test_it_neither_saves_nor_verifies(widget):
    for number, kind in enumerate(("save", "verify", "shutdown")):
        widget.hear(widget, {"number": number, "message": {"kind": kind, "values": {}}}, [])
        assert "expected one of start, answer" in widget.sent[-1]["says"]
    widget.hear(widget, {"number": 9, "message": {"kind": "start"}}, [])
    assert widget.sent[-1]["reply"]["files"] is False


def test_with_a_folder_it_saves_there_and_verifies(tmp_path, monkeypatch):
    saving = camopt.live(SCENE, folder=tmp_path / "designs")
    sent = []
    monkeypatch.setattr(saving, "send", sent.append)

    def tell(message):
        saving.hear(saving, {"number": 1, "message": message}, [])
        return sent[-1].get("reply", sent[-1])

    try:
        assert tell({"kind": "start"})["files"] is True and saving.verification is None
        assert tell({"kind": "save", "what": "scene", "name": "mine", "values": {}})["saved"] == "mine.toml"
        assert [path.name for path in (tmp_path / "designs").iterdir()] == ["mine.toml"]
        assert "expected letters" in tell({"kind": "save", "what": "scene", "name": "../out", "values": {}})["says"]
        assert tell({"kind": "verify", "values": {}})["state"] == "running"
        assert tell({"kind": "cancel"})["state"] == "cancelled" and saving.verification is None
    finally:
        saving.close()


def test_its_module_is_the_page_s(widget):
    assert "export default { render }" in widget._esm and "function trainAnimation" in widget._esm
    assert "http://" not in widget._esm.replace("http://www.w3.org/2000/svg", "") and "https://" not in widget._esm


def test_a_missing_extra_is_named(monkeypatch):
    import sys

    real = builtins.__import__
    monkeypatch.delitem(sys.modules, "camopt.designer.widget", raising=False)

    def without(name, *args, **kwargs):
        if name == "anywidget":
            raise ModuleNotFoundError("No module named 'anywidget'", name="anywidget")
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"anywidget is not installed: pip install 'camopt\[interactive\]'"):
        camopt.live(SCENE)


def test_a_scene_without_speeds_is_refused():
    with pytest.raises(InputError, match="live needs operation"):
        camopt.live(SCENE.model_copy(update={"operation": None}))


@pytest.mark.long
def test_in_a_notebook_the_value_is_the_design():
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed")
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    code = (
        "import camopt\nscene = camopt.load_scene('motori-1')\nwidget = camopt.live(scene)\nwidget",
        "print(repr(widget.value.area_ratio_in(widget.scene.design)))\nwidget.close()",
    )
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in code])
    done = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    first, second = (cell["outputs"] for cell in done["cells"])
    assert any("application/vnd.jupyter.widget-view+json" in output.get("data", {}) for output in first)
    area = float("".join(output["text"] for output in second if output.get("name") == "stdout"))
    assert area == pytest.approx(Session(SCENE).answer({})["area_ratio"], abs=1e-12)
