"""The valve train as SI arrays. These are data only: each method has its own equations and its own contact law."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from camopt.scene.errors import InputError
from camopt.scene.laws import CURVED, LINEAR, TABLE, Laws
from camopt.scene.parts import OIL_OF, laws_of, parts_of
from camopt.scene.schema import Scene
from camopt.scene.units import DEG

GROUND = -1
Computed = TypeVar("Computed")
TRAIN_PARAMETERS = ("mass", "mass_damping", "mass_force", "stiffness", "damping", "preload", "gap")
"""Fields of `Train` whose numbers a user may vary, and with respect to which metrics have derivatives."""
LAW_PARAMETERS = ("dissipation", "table", "leak", "travel", "slip")
"""Fields of `Laws` for which the same holds, in a train that has laws."""


@dataclass(frozen=True, eq=False)
class Forcing:
    """A force on a mass that is periodic in the cam angle and linear between its rows."""

    on: int  # mass index
    angle: np.ndarray  # (q) rad, from -pi to pi
    force: np.ndarray  # (q) N, positive opens; the last equals the first

    def at(self, angle: np.ndarray | float) -> np.ndarray:
        """The force [N] at cam angles [rad] of any revolution, in the shape of the angles."""
        return np.interp((np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi, self.angle, self.force)


@dataclass(frozen=True, eq=False)  # compared and hashed by identity: caches are keyed by the train they belong to
class Train:
    """Masses (n) and elements (e) of a scene in SI units.

    An element e lies between `a[e]` and `b[e]` (mass index, or GROUND) and has the compression
    d = x_a - x_b + cam_driven * lift - gap and the elastic force preload + stiffness * d; it pushes a towards -x and b
    towards +x. If there are `laws`, they determine the elastic force, and `stiffness` only replaces them in modal
    analysis and for step sizes. A hydraulic adjuster of the scene becomes two parallel elements: its plunger, a
    contact, in the adjuster's place, and its oil, `<name>-oil`, after all others.

    The state of a train is (x, v, z): n positions [m], n velocities [m/s], and the memories [m] of r elements.
    """

    mass: np.ndarray  # (n) kg
    mass_damping: np.ndarray  # (n) N s/m, to ground
    mass_force: np.ndarray  # (n) N, constant, positive opens
    a: np.ndarray  # (e) int
    b: np.ndarray  # (e) int
    contact: np.ndarray  # (e) bool
    cam_driven: np.ndarray  # (e) bool
    stiffness: np.ndarray  # (e) N/m
    damping: np.ndarray  # (e) N s/m
    preload: np.ndarray  # (e) N
    gap: np.ndarray  # (e) m
    valve: int  # mass index, -1 where the scene names none
    seat: int  # element index, -1 where the scene names none
    cam_side: tuple[int, ...]  # contacts between cam and valve, in order from the cam
    mass_names: tuple[str, ...]
    element_names: tuple[str, ...]
    laws: Laws | None = None  # None: every law is linear
    forcing: tuple[Forcing, ...] = ()
    adjusters: tuple[int, ...] = ()  # oil columns between cam and valve

    @cached_property
    def memory(self) -> tuple[int, ...]:
        """The elements (r) with a memory, in the order of the state vector."""
        return () if self.laws is None else tuple(int(e) for e in np.flatnonzero(self.laws.has_memory))

    @cached_property
    def incidence(self) -> np.ndarray:
        """Derivative of every compression with respect to the positions, shape (e, n)."""
        ends = np.eye(len(self.mass) + 1)[:, :-1]  # the last row, at index -1, is the ground
        return ends[self.a] - ends[self.b]

    @property
    def straight(self) -> bool:
        """Whether every law is piecewise linear, which event-exact solves exactly; others are replaced by chords."""
        return self.laws is None or not np.any(np.isin(self.laws.kind, CURVED))

    @property
    def state_size(self) -> int:
        """Length of the state vector: 2n + r."""
        return 2 * len(self.mass) + len(self.memory)

    @property
    def lash(self) -> float:
        """Sum of the gaps between cam and valve [m]."""
        return float(sum(self.gap[e] for e in self.cam_side))

    @property
    def touch_compression(self) -> np.ndarray:
        """Compression at which each element's elastic force is zero [m], shape (e)."""
        return -self.preload / self.stiffness if self.laws is None else self.laws.touch(self.preload)

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """The numbers named in TRAIN_PARAMETERS and, in a train with laws, in LAW_PARAMETERS. In a train with laws,
        "stiffness" is the coefficient of each law, which for a contact law is in N/m^exponent."""
        numbers = {name: getattr(self, name) for name in TRAIN_PARAMETERS}
        if self.laws is None:
            return numbers
        return numbers | {"stiffness": self.laws.coefficient} | {n: getattr(self.laws, n) for n in LAW_PARAMETERS}

    def with_parameters(self, numbers: Mapping[str, np.ndarray]) -> "Train":
        """The train with new numbers, under the names and with the shapes of `parameters`."""
        if self.laws is None:
            return replace(self, **numbers)
        of_laws = {name: numbers[name] for name in LAW_PARAMETERS if name in numbers}
        laws = replace(self.laws, coefficient=numbers.get("stiffness", self.laws.coefficient), **of_laws)
        others = {name: number for name, number in numbers.items() if name not in of_laws}
        return replace(self, **{**others, "laws": laws, "stiffness": laws.stand_in()})

    def require_straight(self, method: str, instead: str) -> None:
        """Raises InputError, with the remedy `instead`, if a method for piecewise linear laws meets curved ones."""
        if names := self._with_law(lambda kind: kind in CURVED):
            raise InputError(
                f"{method} needs elements whose force follows straight lines, and these have curved laws: {names}; "
                f"{instead}"
            )

    def require_kinds(self, method: str, kinds: Collection[int], where: str) -> None:
        """Raises InputError if a law's number is not among `kinds`, the laws of the method in the file `where`."""
        if names := self._with_law(lambda kind: kind not in kinds):
            raise InputError(
                f"{method} does not implement the law of {names}: add it to {where}, or take another method"
            )

    def _with_law(self, has: Callable[[int], bool]) -> str:
        """Names of the elements for whose law number `has` is true."""
        kinds = () if self.laws is None else self.laws.kind
        return ", ".join(name for name, kind in zip(self.element_names, kinds, strict=False) if has(kind))

    def compression(self, x: np.ndarray, lift: np.ndarray | float) -> np.ndarray:
        """Compression of every element [m], shape (..., e), for positions x (..., n) [m] and lift (...) [m]."""
        padded = np.concatenate([x, np.zeros((*x.shape[:-1], 1))], axis=-1)  # the index -1 selects the ground
        d = padded[..., self.a] - padded[..., self.b] - self.gap
        return d + self.cam_driven * np.asarray(lift)[..., None]


def kept_with_train(of_train: Callable[[Train], Computed]) -> Callable[[Train], Computed]:
    """Caches a function of a train for as long as the train exists. A search for a yield returns to thousands of drawn
    trains with every cam, while the final statement of the yield uses each train once and releases it."""
    cache = WeakKeyDictionary[Train, Computed]()

    @wraps(of_train)
    def computed(train: Train) -> Computed:
        if train not in cache:
            cache[train] = of_train(train)
        return cache[train]

    return computed


def build_train(scene: Scene) -> Train:
    """The SI arrays of a scene, whose names must already be checked (see `camopt.scene.load`). The same scene returns
    the same train, so that everything cached by train, such as propagators, is computed once."""
    return _built(SceneKey(scene))


class SceneKey:
    """A scene as the key of a cache, compared by identity, since comparing its numbers takes longer than building."""

    def __init__(self, scene: Scene):
        self.scene = scene

    def __hash__(self) -> int:
        return id(self.scene)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneKey) and other.scene is self.scene


@lru_cache(maxsize=16)
def _built(key: SceneKey) -> Train:
    scene = key.scene
    masses, elements = scene.mass, parts_of(scene.element)
    index = {m.name: i for i, m in enumerate(masses)} | {"ground": GROUND}
    a = np.array([index[e.between[0]] for e in elements])
    b = np.array([index[e.between[1]] for e in elements])
    contact = np.array([e.contact for e in elements])
    cam_driven = np.array([e.cam_driven for e in elements])
    valve = index[scene.valve] if scene.valve else -1
    names = tuple(e.name for e in elements)
    way = _way_from_cam_to_valve(a, b, contact, cam_driven, valve)
    plungers = [e for e in way if elements[e].plunger]
    oil = [e for e, part in enumerate(elements) if part.law == "oil"]
    laws = laws_of(elements)
    preload = np.array([e.preload for e in elements])
    return Train(
        mass=np.array([m.mass_kg for m in masses]),
        mass_damping=np.array([m.damping_N_s_per_m for m in masses]),
        mass_force=np.array([m.force_N for m in masses]),
        a=a,
        b=b,
        contact=contact,
        cam_driven=cam_driven,
        stiffness=laws.stand_in(),
        damping=np.array([e.damping for e in elements]),
        preload=np.where(laws.kind == TABLE, laws.force(np.zeros(len(elements)), preload), preload),
        gap=np.array([e.gap for e in elements]),
        valve=valve,
        seat=names.index(scene.seat) if scene.seat else -1,
        cam_side=tuple(e for e in way if contact[e] and e not in plungers),
        mass_names=tuple(m.name for m in masses),
        element_names=names,
        laws=laws if np.any(laws.kind != LINEAR) else None,
        forcing=tuple(Forcing(index[f.on], *(np.array(f.table) * (DEG, 1.0)).T) for f in scene.force),
        adjusters=tuple(e for e in oil if elements[e].name in [OIL_OF.format(names[p]) for p in plungers]),
    )


def _way_from_cam_to_valve(a, b, contact, cam_driven, valve) -> tuple[int, ...]:
    """Elements on the path from the cam-driven one to the valve. No path leads through the ground."""
    if valve < 0:
        return ()
    for first in np.flatnonzero(cam_driven & (b != GROUND)):
        ways: list[tuple[int, tuple[int, ...]]] = [(int(b[first]), (int(first),))]
        seen = {GROUND}
        while ways:
            mass, path = ways.pop(0)
            if mass == valve:
                return path
            seen.add(mass)
            for e in range(len(a)):
                if e in path or mass not in ((a[e],) if contact[e] else (a[e], b[e])):
                    continue
                far_end = int(b[e] if a[e] == mass else a[e])
                if far_end not in seen:
                    ways.append((far_end, (*path, e)))
    return ()
