import re

import pytest

from camopt.report.figures import inline_svg, ordered

OPEN = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 460.8 300">'


def svg(inside: str) -> str:
    return f"{OPEN}{inside}</svg>"


def test_drawing_survives_and_scripts_do_not():
    text = inline_svg(
        svg(
            "<style>* {fill: red}</style><script>alert(1)</script><foreignObject><p>x</p></foreignObject>"
            '<image href="http://example.org/x.png"/><a href="javascript:alert(1)"><path d="M 9 9"/></a>'
            '<path d="M 0 0 L 1 1" style="fill: none" onclick="alert(1)" class="c"/>'
        ),
        1,
    )
    assert re.findall(r"<(\w+)", text) == ["svg", "path"]
    assert 'd="M 0 0 L 1 1"' in text and 'style="fill: none"' in text
    for word in ("alert", "onclick", "example.org", "class", "red"):
        assert word not in text


def test_ids_and_references_get_the_figure_s_own_names():
    inside = '<defs><clipPath id="c"/><path id="m" d="M 0 0"/></defs><g clip-path="url(#c)"><use xlink:href="#m"/></g>'
    text = inline_svg(svg(inside), 7)
    assert re.findall(r' id="([^"]*)"', text) == ["f7-c", "f7-m"]
    assert 'clip-path="url(#f7-c)"' in text and 'xlink:href="#f7-m"' in text


@pytest.mark.parametrize(
    "inside",
    [
        '<use xlink:href="http://example.org/a.svg#x"/>',
        '<use href="data:image/svg+xml,x"/>',
        '<g clip-path="url(http://example.org/#c)"/>',
        '<rect style="fill: URL(http://example.org/x)"/>',
    ],
)
def test_references_to_the_outside_are_dropped(inside):
    text = inline_svg(svg(inside), 1)
    assert "example.org" not in text and "data:" not in text


def test_width_is_kept_readable():
    assert "min-width: 461px" in inline_svg(svg(""), 1)
    assert "min-width" not in inline_svg(svg("").replace("460.8", "4;position:fixed"), 1)


@pytest.mark.parametrize("text", ["", "<svg", "<html/>", '<!DOCTYPE svg [<!ENTITY a "b">]>' + svg("&a;")])
def test_what_is_no_figure_is_refused(text):
    with pytest.raises(ValueError):
        inline_svg(text, 1)


def test_known_figures_come_in_the_page_s_order():
    assert ordered(dict.fromkeys(("zeta", "convergence", "alpha", "profiles"), "")) == [
        "profiles",
        "convergence",
        "alpha",
        "zeta",
    ]
