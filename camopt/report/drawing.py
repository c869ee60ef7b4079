"""Layout of the drawing of a valve train, from the graph of the scene and the space that the follower needs about the
cam.

Positions increase down the page, in the direction in which the valve opens. In an element between a and b, a moves
towards +x to compress it, so a is drawn above b: the seat lies above the valve and the spring's foot below it, as in an
engine. Lengths are pixels of the drawing where no other unit is given; masses move by `SCALE` pixels per millimetre.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse.csgraph import connected_components, shortest_path

from camopt.cam.followers import Arm
from camopt.scene.geometry import SWINGING, Geometry
from camopt.scene.train import GROUND, Train
from camopt.scene.units import MM

BASE_MM = 16.0
"""Radius of the base circle that is drawn for a scene without [geometry] [mm]."""
PIVOT_MM = 4.0
"""Space about a pivot [mm]."""
SWING_MM = 12.0
"""Space above a roller or pad that lies above the cam's axis, for its motion with the lift [mm]."""

SCALE = 4.0
"""Scale of the motion and of the cam [px/mm]."""
LANE = 58.0
"""Distance between neighbouring elements of one mass [px]."""
COIL_MM = 0.5
"""An element whose compression varies by more than this [mm] is drawn as a coil, a stiffer one as a rod."""
LENGTH = {"coil": 30.0, "rod": 18.0, "contact": 36.0}
"""Shortest length of an element [px]; a contact is longer because its gap is drawn magnified."""
HEIGHT = {"valve": 22.0, "mass": 22.0, "small": 12.0, "hub": 10.0}
MARGIN = 14.0
WORDS = 54.0
"""Space for the text beside a mass or a contact [px]."""
STROKE_MM = 10.0
"""Space below the lowest mass, for its motion [mm]."""


class FollowerRoom(NamedTuple):
    """Extent of cam and follower about the cam's axis, with the follower on the base circle [mm], and the horizontal
    distance of the valve's train from that axis, `train` [mm]."""

    left: float
    right: float
    above: float
    below: float
    train: float = 0.0


def drawn_follower(geometry: Geometry | None) -> dict:
    """The page's `follower`, `roller_radius_mm`, `base_radius_mm`, `turn` and `arm`.

    `turn` is -1 where the drawing is mirrored, so that the train is always to the right of the cam. `arm` is None, or
    describes a finger or rocker with the valve shut: `pivot`, `centre` (of the roller or pad) and `valve` [mm from the
    cam's axis, right and down], `radius` [mm], `rolls` (whether it has a roller), length `valve_arm_mm` and angle
    `shut_deg` of its valve arm, and the `side` of the pivot on which that arm lies.
    """
    drawn = {"follower": "point", "roller_radius_mm": 0.0, "base_radius_mm": BASE_MM, "turn": 1, "arm": None}
    if geometry is None:
        return drawn
    radius = geometry.roller_radius_mm
    drawn |= {
        "follower": geometry.follower,
        "roller_radius_mm": radius or 0.0,
        "base_radius_mm": geometry.base_radius_mm,
    }
    if geometry.follower not in SWINGING:
        return drawn
    arm = Arm(geometry)
    turn = 1 if arm.valve.imag >= 0 else -1

    def right_and_down(point: complex) -> list[float]:
        return [round(float(turn * point.imag / MM), 4), round(float(point.real / MM), 4)]

    parts = {name: right_and_down(getattr(arm, name)) for name in ("pivot", "centre", "valve")}
    parts |= {"radius": arm.radius / MM, "rolls": radius is not None, "valve_arm_mm": geometry.valve_arm_mm}
    return drawn | {"turn": turn, "arm": parts | {"shut_deg": geometry.valve_arm_deg, "side": turn * arm.valve_side}}


def room_for(drawn: dict, radius_mm: float) -> FollowerRoom:
    """Space of a follower given by `drawn_follower`, about cams whose largest radius is `radius_mm`."""
    arm = drawn["arm"]
    if arm is None:
        below = drawn["base_radius_mm"] + 2 * drawn["roller_radius_mm"]
        return FollowerRoom(radius_mm, radius_mm, radius_mm, below)
    places = np.array([arm["pivot"], arm["centre"], arm["valve"]])
    reach = np.array([PIVOT_MM, arm["radius"], PIVOT_MM])
    right, below = np.maximum((places + reach[:, None]).max(axis=0), radius_mm)
    left, above = np.maximum((reach[:, None] - places).max(axis=0), radius_mm)
    return FollowerRoom(left, right, above + (SWING_MM if arm["centre"][1] < 0 else 0.0), below, arm["valve"][0])


def strokes(train: Train, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two lengths per element (e) [mm] for the positions x (k, n) [mm] of all motions: by how much its ends come closer
    than in the installed position, and the range of its compression while it is compressed, 0 for the element that the
    cam drives."""
    padded = np.concatenate([x, np.zeros((len(x), 1))], axis=1)
    d = padded[:, train.a] - padded[:, train.b]
    beyond = d - (train.gap + train.touch_compression) / MM
    squeezed = np.where(train.contact, np.maximum(beyond, 0.0), beyond)
    return np.maximum(d.max(axis=0), 0.0), np.where(train.cam_driven, 0.0, np.ptp(squeezed, axis=0))


def drawing(train: Train, x: np.ndarray, room: FollowerRoom) -> dict:
    """Masses and elements in pixels for positions x (k, n) [mm] of all motions, with `room` for cam and follower.

    Keys: width, height, scale; masses: name, kind (mass, valve, small, or hub, which carries the cam), x, y, left,
    right, height; elements: name, look (coil, rod, cam), contact, a, b (-1: ground), x, top and bottom (y of an end on
    the ground, else None), and words (side of the text, -1: left).
    """
    kinds, (approach, span) = _kinds(train), strokes(train, x)
    looks = ["cam" if c else "coil" if s > COIL_MM else "rod" for c, s in zip(train.cam_driven, span, strict=True)]
    half = np.array([HEIGHT[k] / 2 for k in kinds])
    need = []  # least distance between the ends of each element in the installed position
    for look, contact, near in zip(looks, train.contact, approach, strict=True):
        length = LENGTH["coil" if look == "coil" else "rod"] if not contact else LENGTH["contact"]
        length += LENGTH["coil"] / 2 if contact and look == "coil" else 0.0
        need.append(length + SCALE * (near + (room.below if look == "cam" else 0.0)))
    y = _heights(train, need, half)
    column = _columns(train, y)
    offset, lanes = _lanes(train, column, y)
    widths = [max((abs(o) for e, o in enumerate(offset) if lanes[e] == c), default=0) for c in range(max(column) + 1)]
    centre = np.cumsum([0.0, *(LANE * (a + b + 1.15) for a, b in pairwise(widths))])
    hubs = _hubs(train)
    carriers = [*hubs, GROUND]  # elements between these, and the one driven by the cam, are drawn at the cam
    beside = train.cam_driven | (np.isin(train.a, carriers) & np.isin(train.b, carriers))
    across = (centre[lanes] + LANE * np.array(offset) - np.where(beside, room.train * SCALE, 0.0)).tolist()
    masses = []
    for i, (name, kind) in enumerate(zip(train.mass_names, kinds, strict=True)):
        middle = float(centre[column[i]]) - (room.train * SCALE if i in hubs else 0.0)
        joined = [across[e] for e in np.flatnonzero(((train.a == i) | (train.b == i)) & ~train.cam_driven)]
        pad = {"small": 20.0, "hub": 10.0}.get(kind, 34.0)
        left, right = min([*joined, middle]) - pad, max([*joined, middle]) + pad  # over all its elements
        masses.append({"name": name, "kind": kind, "x": middle, "y": float(y[i]), "left": left, "right": right,
                       "height": 2 * float(half[i])})  # fmt: skip
    elements = []
    for e, name in enumerate(train.element_names):
        a, b = int(train.a[e]), int(train.b[e])
        top = None if a != GROUND else float(y[b] - half[b] - need[e])
        bottom = None if b != GROUND else float(y[a] + half[a] + need[e])
        place = {"x": across[e], "top": top, "bottom": bottom, "words": -1 if offset[e] < 0 else 1}
        elements.append({"name": name, "look": looks[e], "contact": bool(train.contact[e]), "a": a, "b": b} | place)
    return _framed(masses, elements, room)


def _kinds(train: Train) -> list[str]:
    """Kind of every mass: the valve, a hub that carries the cam, a small mass (of a spring's coils), or a mass."""
    hubs, path, small = _hubs(train), _path(train), 0.5 * train.mass[train.valve]
    return [
        "valve" if i == train.valve else "hub" if i in hubs else "small" if m < small and i not in path else "mass"
        for i, m in enumerate(train.mass)
    ]


def _hubs(train: Train) -> set[int]:
    """Masses that carry the cam."""
    return {int(train.a[e]) for e in np.flatnonzero(train.cam_driven)} - {GROUND}


def _links(train: Train) -> np.ndarray:
    """Adjacency matrix (n, n) of the masses: True where an element joins two."""
    linked = np.zeros((len(train.mass), len(train.mass)), dtype=bool)
    held = (train.a != GROUND) & (train.b != GROUND)
    linked[train.a[held], train.b[held]] = linked[train.b[held], train.a[held]] = True
    return linked


def _path(train: Train) -> list[int]:
    """Masses on the shortest path from the cam to the valve, beginning with the one under the cam."""
    first, path = int(train.b[np.flatnonzero(train.cam_driven)[0]]), [train.valve]
    _, before = shortest_path(_links(train), unweighted=True, indices=first, return_predecessors=True)
    while before[path[0]] >= 0:
        path.insert(0, int(before[path[0]]))
    return path if path[0] == first else [first]


def _heights(train: Train, need: list[float], half: np.ndarray) -> np.ndarray:
    """y of every mass: as high as the elements above it allow. In a cycle of elements the first mass comes first."""
    n = len(half)
    between = [
        (int(a), int(b), e) for e, (a, b) in enumerate(zip(train.a, train.b, strict=True)) if GROUND not in (a, b)
    ]
    y, waiting = np.zeros(n), set(range(n))
    while waiting:
        free = [i for i in waiting if not any(b == i and a in waiting and a != i for a, b, _ in between)]
        i = min(free or waiting)
        above = [y[a] + half[a] + need[e] + half[i] for a, b, e in between if b == i and a not in waiting]
        y[i] = max(above, default=0.0)
        waiting.remove(i)
    for i in range(n - 1, -1, -1):  # a mass with nothing above it is moved down to the mass below
        below = [y[b] - half[b] - need[e] - half[i] for a, b, e in between if a == i]
        if below and not any(b == i for _, b, _ in between):
            y[i] = min(below)
    return y


def _columns(train: Train, y: np.ndarray) -> list[int]:
    """Column of every mass: 0 from the cam to the valve, then one per branch, and more where masses are level."""
    column = dict.fromkeys([*_path(train), *(int(train.a[e]) for e in np.flatnonzero(train.cam_driven))], 0)
    column.pop(GROUND, None)
    rest = [i for i in range(len(y)) if i not in column]
    _, branches = connected_components(_links(train)[np.ix_(rest, rest)], directed=False)
    used = 1
    for branch in dict.fromkeys(branches.tolist()):
        level: dict[float, int] = {}
        for i in (rest[k] for k in np.flatnonzero(branches == branch)):
            place = level.get(round(float(y[i])), 0)
            column[i] = used + place
            level[round(float(y[i]))] = place + 1
        used += max(level.values())
    return [column[i] for i in range(len(y))]


def _lanes(train: Train, column: list[int], y: np.ndarray) -> tuple[list[int], list[int]]:
    """For every element its offset from the middle of a column, in lanes, and that column."""
    offset, lane = [0] * len(train.a), [0] * len(train.a)
    taken: set[tuple[int, str, int]] = set()
    order = sorted(range(len(train.a)), key=lambda e: (not train.cam_driven[e], GROUND in (train.a[e], train.b[e]), e))
    for e in order:
        ends = [(int(m), side) for m, side in ((train.a[e], "below"), (train.b[e], "above")) if m != GROUND]
        lane[e] = max(column[m] for m, _ in ends)
        here = [end for end in ends if column[end[0]] == lane[e]]
        places = [0, -1, 1, -2, 2, -3, 3]
        if len(here) == 2:
            low, high = sorted(y[m] for m, _ in here)
            passed = any(c == lane[e] and low < v < high for c, v in zip(column, y, strict=True))
            places = places[3:] if passed else places  # beside the masses between its ends
        offset[e] = next((p for p in places if not any((*end, p) in taken for end in here)), places[-1])
        taken |= {(*end, offset[e]) for end in here}
    return offset, lane


def _framed(masses: list[dict], elements: list[dict], room: FollowerRoom) -> dict:
    """The drawing shifted so that everything, including the turning cam and the text at the sides, lies inside."""
    cams = [(e["x"], masses[e["a"]]["y"] if e["a"] != GROUND else e["top"]) for e in elements if e["look"] == "cam"]
    grounds = [e[end] for e in elements for end in ("top", "bottom") if e[end] is not None]
    left = min(
        [m["left"] for m in masses] + [x - room.left * SCALE for x, _ in cams] + [e["x"] - WORDS for e in elements]
    )
    right = max([m["right"] + WORDS for m in masses] + [x + room.right * SCALE for x, _ in cams])
    top = min([m["y"] - m["height"] for m in masses] + [y - room.above * SCALE for _, y in cams] + grounds)
    low = max([m["y"] + m["height"] + STROKE_MM * SCALE for m in masses] + grounds)
    dx, dy = MARGIN - left, MARGIN - top
    for m in masses:
        m |= {"x": m["x"] + dx, "left": m["left"] + dx, "right": m["right"] + dx, "y": m["y"] + dy}
    for e in elements:
        e["x"] += dx
        e |= {end: None if e[end] is None else e[end] + dy for end in ("top", "bottom")}
    size = {"width": right + dx + MARGIN, "height": low + dy + MARGIN}
    return {**size, "scale": SCALE, "masses": masses, "elements": elements}
