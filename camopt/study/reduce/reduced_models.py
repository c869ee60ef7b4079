"""Smaller models of a scene: its spring reduced to the lowest surge modes, stiffly held masses condensed statically.

The spring is reduced after Craig and Bampton (1968, AIAA Journal 6), with the valve's end and the ground as interface.
Each surge mode that is kept becomes one mass attached to the valve's end: a mode of participation l and frequency omega
becomes the mass l^2 on the stiffness l^2 omega^2. The mass of the other modes moves with that end. The rate, the mass
felt at the valve's end and the kept surge frequencies are therefore exact, and keeping all modes only changes
coordinates. Masses are condensed after Guyan (1965, AIAA Journal 3): a mass between two elements follows them
statically, and the two become one in series.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from camopt.scene import InputError, Scene, parse_scene
from camopt.scene.element import Element
from camopt.scene.parameters import KEYS
from camopt.scene.schema import Mass
from camopt.scene.text_file import scene_toml
from camopt.scene.units import MM

MOST_SURGE_MASSES = 5
"""Surge masses of the largest reduced spring; a spring with more coils is also kept unreduced."""
Chain = tuple[str, list[Mass], list[Element]]
"""A divided spring: its head, a row of N masses from there to the ground, held by bilateral springs only, and the N + 1
springs, each oriented from the head to the ground."""


@dataclass(frozen=True)
class SmallerModel:
    """A smaller model as an ordinary scene, and the reductions that led to it."""

    scene: Scene
    surge_masses: int
    condensed: tuple[str, ...]  # masses condensed, in this order

    @property
    def done(self) -> str:
        """The reductions in words."""
        merged = f"condensed {', '.join(self.condensed)}" if self.condensed else "every other mass kept"
        return f"{self.surge_masses} {'mass' if self.surge_masses == 1 else 'masses'} of the spring; {merged}"


def smaller_models(scene: Scene, keep: frozenset[str] = frozenset()) -> list[SmallerModel]:
    """Every combination of fewer spring masses and condensed masses, with the scene itself first.

    Masses named in `keep` are not changed. Masses are condensed by descending frequency of the mass between its two
    elements. Each model is a checked scene named `<scene>-<masses>m-<surge masses>s`.
    """
    divided = chains(scene, keep)
    coils = max((len(masses) for _, masses, _ in divided), default=0)
    models = []
    for surge in (coils, *range(min(coils - 1, MOST_SURGE_MASSES), -1, -1)):
        current, condensed = (scene if surge == coils else fewer_coils(scene, divided, surge)), ()
        stiff = {m.name for m in current.mass} - {m.name for _, masses, _ in divided for m in masses} - keep
        models.append(_named(scene, current, surge, condensed))
        while (name := _stiffest(current, stiff)) is not None:
            current, condensed = condense(current, name), (*condensed, name)
            try:
                models.append(_named(scene, current, surge, condensed))
            except InputError:  # a remaining mass is not held at rest: not a valid scene
                break
    return models


def _named(full: Scene, scene: Scene, surge: int, condensed: tuple[str, ...]) -> SmallerModel:
    if scene is full:
        return SmallerModel(full, surge, condensed)
    name = f"{full.name[:48]}-{len(scene.mass)}m-{surge}s"
    named = scene.model_copy(update={"name": name, "tolerance": ()})  # tolerances may name numbers that no longer exist
    return SmallerModel(parse_scene(scene_toml(named), named.name), surge, condensed)


def chains(scene: Scene, keep: frozenset[str] = frozenset()) -> list[Chain]:
    """The divided springs of a scene, except those that contain a mass of `keep`."""
    coil = {}
    for mass in scene.mass:
        held = _touching(scene, mass.name)
        bilateral = len(held) == 2 and all(e.kind == "spring" and e.law == "linear" for e in held)
        free = mass.name != scene.valve and mass.damping_N_s_per_m == 0 and mass.force_N == 0
        if bilateral and free and mass.name not in keep:
            coil[mass.name] = mass
    divided = []
    for last in scene.element:
        if last.kind != "spring" or last.law != "linear" or "ground" not in last.between:
            continue
        springs = [_turned(last, "ground", at_start=False)]
        at = springs[0].between[0]
        masses: list[Mass] = []
        while at in coil and coil[at] not in masses:
            masses.append(coil[at])
            (nearer,) = (e for e in _touching(scene, at) if e.name != springs[-1].name)
            springs.append(_turned(nearer, at, at_start=False))
            at = springs[-1].between[0]
        if masses and at != "ground" and at not in coil:
            divided.append((at, masses[::-1], springs[::-1]))
    return divided


def fewer_coils(scene: Scene, divided: list[Chain], surge: int) -> Scene:
    """The scene with each divided spring replaced by its rate and its `surge` lowest modes (all, where it has fewer).

    Damping between a mode and the spring's end, zero in a uniform spring, and damping between modes are neglected.
    """
    masses, elements = {m.name: m for m in scene.mass}, {e.name: e for e in scene.element}
    for number, chain in enumerate(divided, 1):
        head, coils, springs = chain
        for coil in coils:
            del masses[coil.name]
        for spring in springs:
            del elements[spring.name]
        modal, residual, modal_springs = _modal(chain, number, surge)
        masses[head] = masses[head].model_copy(update={"mass_kg": masses[head].mass_kg + residual})
        masses |= {m.name: m for m in modal}
        elements |= {e.name: e for e in modal_springs}
    return scene.model_copy(update={"mass": tuple(masses.values()), "element": tuple(elements.values())})


def _modal(chain: Chain, number: int, surge: int) -> tuple[list[Mass], float, list[Element]]:
    """Masses of the kept modes, the mass [kg] that moves with the head, and the springs."""
    head, coils, parts = chain
    k = np.array([_stiffness(e) for e in parts])
    c = np.array([e.damping_N_s_per_m for e in parts])
    mass = np.array([m.mass_kg for m in coils])
    rows = np.eye(len(k), len(mass), -1) - np.eye(len(k), len(mass))  # compressions, with the head at rest
    static = np.linalg.solve(rows.T @ (k[:, None] * rows), k[0] * np.eye(len(mass))[0])  # for a unit move of the head
    stretch = rows @ static
    stretch[0] += 1.0
    squares, shapes = eigh(rows.T @ (k[:, None] * rows), np.diag(mass), subset_by_index=[0, len(mass) - 1])
    shapes = shapes[:, :surge]
    share = (shapes.T @ (mass * static)) ** 2  # kg
    damping = share * np.einsum("em,e,em->m", rows @ shapes, c, rows @ shapes)
    compliance = 1.0 / k
    rate = 1.0 / compliance.sum()
    preload = rate * sum(_preload(e) / _stiffness(e) for e in parts)
    whole = _spring(f"static_spring_{number}", head, "ground", rate, float(c @ stretch**2), float(preload))
    masses, springs = [], [whole]
    for j, kg in enumerate(share, 1):
        name = f"surge_{number}_{j}"
        masses.append(Mass(name=name, mass_kg=float(kg)))
        springs.append(_spring(name, head, name, float(kg * squares[j - 1]), float(damping[j - 1]), 0.0))
    return masses, float(mass @ static**2 - share.sum()), springs


def condense(scene: Scene, name: str) -> Scene:
    """The scene without a mass that is held by two linear elements; these act in series, with damping by their shares.

    Its mass, damping and force go to the masses at its springs by stiffness; between two contacts, to the mass that
    pushes it open, or past a cam-driven contact to the mass that it pushes. A share of the ground is dropped. If the
    mass was the valve, the mass it is attached to becomes the valve. Raises InputError for a mass held otherwise.
    """
    pair = _in_series(scene, name)
    if pair is None:
        raise InputError(
            f"scene {scene.name}: mass {name!r} is not held by two linear elements in series: name another mass"
        )
    first, second = pair
    k1, k2 = _stiffness(first), _stiffness(second)
    k = k1 * k2 / (k1 + k2)
    contacts = [e for e in pair if e.kind == "contact"]
    named = next((e for e in pair if e.name == scene.seat), (contacts or [first])[0])
    series = Element(
        name=named.name,
        kind="contact" if contacts else "spring",
        between=(first.between[0], second.between[1]),
        stiffness_N_per_m=k,
        damping_N_s_per_m=k**2 * (first.damping_N_s_per_m / k1**2 + second.damping_N_s_per_m / k2**2),
        preload_N=k * (first.preload_N / k1 + second.preload_N / k2),
        gap_mm=first.gap_mm + second.gap_mm,
        cam_driven=first.cam_driven or second.cam_driven,
    )
    valve = scene.valve
    if name == valve:
        valve = next(end for end in series.between if end != "ground")
    masses = _shared(scene, name, first, second)
    dropped = {first.name, second.name} - {named.name}
    elements = tuple(series if e.name == named.name else e for e in scene.element if e.name not in dropped)
    return scene.model_copy(update={"mass": masses, "element": elements, "valve": valve})


def _shared(scene: Scene, name: str, first: Element, second: Element) -> tuple[Mass, ...]:
    """The other masses, with their shares of the condensed one."""
    springs = [(e, e.between[i]) for e, i in ((first, 0), (second, 1)) if e.kind == "spring"]
    carrier = second.between[1] if first.cam_driven else first.between[0]  # the lift lies between the mass and the cam
    ends = [(end, _stiffness(e)) for e, end in springs] or [(carrier, 1.0)]
    total = sum(weight for _, weight in ends)
    share = {end: weight / total for end, weight in ends}
    (condensed,) = (m for m in scene.mass if m.name == name)
    keys = KEYS["mass"]
    return tuple(
        m.model_copy(update={key: getattr(m, key) + share.get(m.name, 0.0) * getattr(condensed, key) for key in keys})
        for m in scene.mass
        if m.name != name
    )


def _stiffest(scene: Scene, candidates: set[str]) -> str | None:
    """The mass that can be condensed and has the highest frequency between its two elements."""
    squares = {}
    for mass in scene.mass:
        pair = _in_series(scene, mass.name) if mass.name in candidates else None
        if pair is None or (mass.name == scene.valve and pair[0].between[0] == pair[1].between[1]):
            continue
        squares[mass.name] = (_stiffness(pair[0]) + _stiffness(pair[1])) / mass.mass_kg
    return max(squares, key=lambda name: squares[name], default=None)


def _in_series(scene: Scene, name: str) -> tuple[Element, Element] | None:
    """The two elements of a mass, oriented so that the first ends and the second starts there; None if that fails."""
    held = _touching(scene, name)
    if len(held) != 2 or any(e.law != "linear" for e in held):
        return None
    for first, second in (held, held[::-1]):
        if all(e.kind == "spring" or e.between[i] == name for e, i in ((first, 1), (second, 0))):
            first, second = _turned(first, name, at_start=False), _turned(second, name, at_start=True)
            return (first, second) if first.between[0] != second.between[1] else None
    return None


def _turned(element: Element, end: str, at_start: bool) -> Element:
    """The element with `end` at its start or end; reversing a spring changes the signs of its force and compression."""
    if element.between[0 if at_start else 1] == end:
        return element
    update = {"between": element.between[::-1], "preload_N": -_preload(element), "gap_mm": 0.0}
    return element.model_copy(update=update)


def _touching(scene: Scene, name: str) -> list[Element]:
    return [e for e in scene.element if name in e.between]


def _stiffness(element: Element) -> float:
    assert element.stiffness_N_per_m is not None, "linear elements have one"
    return element.stiffness_N_per_m


def _preload(element: Element) -> float:
    """Force [N] at zero distance, with the gap included."""
    return element.preload_N - _stiffness(element) * element.gap_mm * MM


def _spring(name: str, a: str, b: str, stiffness: float, damping: float, preload: float) -> Element:
    return Element(
        name=name, kind="spring", between=(a, b), stiffness_N_per_m=stiffness, damping_N_s_per_m=damping,
        preload_N=preload,
    )  # fmt: skip
