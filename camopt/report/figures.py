"""Figures of a run folder made safe to stand in a page: drawing elements only, ids of their own, no outside address."""

import re
from xml.etree import ElementTree

SVG = "http://www.w3.org/2000/svg"
XLINK = "{http://www.w3.org/1999/xlink}href"
ELEMENTS = {
    "svg", "g", "defs", "path", "use", "clipPath", "rect", "circle", "ellipse", "line", "polyline", "polygon", "text",
    "tspan", "title", "desc",
}  # fmt: skip
ATTRIBUTES = {
    "viewBox", "id", "d", "style", "transform", "x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "r", "rx", "ry", "points",
    "width", "height", "clip-path", "clip-rule", "clipPathUnits", "fill", "fill-opacity", "fill-rule", "stroke",
    "stroke-width", "stroke-opacity", "stroke-linecap", "stroke-linejoin", "stroke-dasharray", "opacity", "font-size",
    "font-family", "font-weight", "text-anchor",
}  # fmt: skip
OWN_REFERENCE = re.compile(r"url\(#([\w.-]+)\)")

CAPTIONS = {
    "profiles": ("The cams", "Lift, velocity, acceleration and jerk against cam angle; dashed lines are the limits."),
    "valve_motion": (
        "The valve's motion",
        "Valve lift, its closing enlarged, and the contact forces between cam and valve, at each speed; where a force "
        "is zero the contact is open.",
    ),
    "bounce_against_speed": (
        "Bounce and jump over the band",
        "Linear up to 0.01 mm, logarithmic above. The curves are event-exact alone; the verdict rests on the marked "
        "speeds and, where it was asked for, on the band.",
    ),
    "convergence": (
        "The search",
        "Area ratio of its steps, and worst bounce or, for a yield, the drawn trains that fail; only filled steps may "
        "be returned.",
    ),
    "prices": (
        "What tolerances cost",
        "Change of the largest area ratio where a tolerance is left out or halved, and for every per cent by which the "
        "numbers that it moves are raised; lines are standard errors.",
    ),
    "modes": ("Natural modes", "Shapes over the masses, of unit norm, with their frequencies."),
}
"""Figures that a run writes, in the order of the page: title and caption."""


def ordered(figures: dict[str, str]) -> list[str]:
    """Names of the figures: the known ones in the page's order, then any others by name."""
    return [n for n in CAPTIONS if n in figures] + sorted(n for n in figures if n not in CAPTIONS)


def inline_svg(text: str, number: int) -> str:
    """The drawing of an SVG file as one element for a page, where its ids begin with `f<number>-`.

    Scripts, styles, images, links, foreign content and every attribute that only drawing does not need are left out.
    Raises ValueError where the file is no SVG.
    """
    if "<!ENTITY" in text:
        raise ValueError("it declares entities, which no figure needs")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is no XML ({error})") from error
    if root.tag != f"{{{SVG}}}svg":
        raise ValueError("it is no SVG")
    prefix = f"f{number}-"
    _strip(root, prefix)
    for key in ("width", "height", "id", "style"):
        root.attrib.pop(key, None)
    width = root.get("viewBox", "").split()[2:3]
    if width and re.fullmatch(r"\d+(\.\d*)?", width[0]):  # small screens scroll rather than shrink the letters
        root.set("style", f"min-width: {float(width[0]):.0f}px; max-width: {1.75 * float(width[0]):.0f}px")
    root.set("stroke-linejoin", "round")  # what matplotlib says in the style element that was left out
    root.set("stroke-linecap", "butt")
    root.set("aria-hidden", "true")  # glyphs are outlines: the caption speaks for the figure
    ElementTree.register_namespace("", SVG)
    ElementTree.register_namespace("xlink", "http://www.w3.org/1999/xlink")
    return ElementTree.tostring(root, encoding="unicode")


def _strip(element: ElementTree.Element, prefix: str) -> None:
    for child in list(element):
        if not isinstance(child.tag, str) or child.tag.removeprefix(f"{{{SVG}}}") not in ELEMENTS:
            element.remove(child)
        else:
            _strip(child, prefix)
    for key, value in list(element.attrib.items()):
        if key in (XLINK, "href") and value.startswith("#"):
            element.set(key, f"#{prefix}{value[1:]}")
        elif key not in ATTRIBUTES:
            del element.attrib[key]
        elif key == "id":
            element.set(key, prefix + value)
        elif "url" in value.lower():
            if OWN_REFERENCE.fullmatch(value):
                element.set(key, OWN_REFERENCE.sub(rf"url(#{prefix}\1)", value))
            else:
                del element.attrib[key]
