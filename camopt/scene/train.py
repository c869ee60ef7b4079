"""The valve train as SI arrays, which are data only: each path has its own equations and its own contact law."""

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
"""Fields of `Train` whose numbers a user may vary, and by which metrics have derivatives."""
LAW_PARAMETERS = ("dissipation", "table", "leak", "travel", "slip")
"""Fields of `Laws` of which the same is true, in a train that has laws."""


@dataclass(frozen=True, eq=False)
class Forcing:
    """A force on a mass that repeats with the cam angle, in straight lines between its rows."""

    on: int  # mass index
    angle: np.ndarray  # (q) rad, from -pi to pi
    force: np.ndarray  # (q) N, positive opens; the last is the first

    def at(self, angle: np.ndarray | float) -> np.ndarray:
        """The force [N] at cam angles [rad] of any revolution, in their shape."""
        return np.interp((np.asarray(angle) + np.pi) % (2.0 * np.pi) - np.pi, self.angle, self.force)


@dataclass(frozen=True, eq=False)  # compared and hashed by identity: caches are keyed by the train they belong to
class Train:
    """Masses (n) and elements (e) of a scene in SI units.

    An element e stands between `a[e]` and `b[e]` (mass index, or GROUND) with compression
    d = x_a - x_b + cam_driven * lift - gap and elastic force preload + stiffness * d; it pushes a towards -x and b
    towards +x. Where `laws` are given they rule the elastic force, and `stiffness` is only their stand-in for modes
    and step sizes. A hydraulic adjuster of the scene is two elements here, side by side: its plunger, a contact, in
    the adjuster's place, and its oil, `<name>-oil`, after all others.

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
        """The elements (r) with a memory, in the order in which the state holds them."""
        return () if self.laws is None else tuple(int(e) for e in np.flatnonzero(self.laws.has_memory))

    @cached_property
    def incidence(self) -> np.ndarray:
        """Derivative of every compression by the positions, shape (e, n)."""
        ends = np.eye(len(self.mass) + 1)[:, :-1]  # the last row, which the index -1 reads: the ground
        return ends[self.a] - ends[self.b]

    @property
    def straight(self) -> bool:
        """Whether every law consists of straight lines, which event-exact takes as they are; others go by chords."""
        return self.laws is None or not np.any(np.isin(self.laws.kind, CURVED))

    @property
    def state_size(self) -> int:
        """Numbers in a state: 2n + r."""
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
        """The numbers by TRAIN_PARAMETERS and, of a train with laws, by LAW_PARAMETERS.

        The stiffness of a train with laws is the coefficient of each law, of a law of contacts in N/m^exponent.
        """
        numbers = {name: getattr(self, name) for name in TRAIN_PARAMETERS}
        if self.laws is None:
            return numbers
        return numbers | {"stiffness": self.laws.coefficient} | {n: getattr(self.laws, n) for n in LAW_PARAMETERS}

    def with_parameters(self, numbers: Mapping[str, np.ndarray]) -> "Train":
        """The train with other numbers, under the names and with the shapes of `parameters`."""
        if self.laws is None:
            return replace(self, **numbers)
        of_laws = {name: numbers[name] for name in LAW_PARAMETERS if name in numbers}
        laws = replace(self.laws, coefficient=numbers.get("stiffness", self.laws.coefficient), **of_laws)
        others = {name: number for name, number in numbers.items() if name not in of_laws}
        return replace(self, **{**others, "laws": laws, "stiffness": laws.stand_in()})

    def require_straight(self, method: str, instead: str) -> None:
        """Raises InputError, with the remedy `instead`, where a method for straight lines meets curved laws."""
        if names := self._with_law(lambda kind: kind in CURVED):
            raise InputError(
                f"{method} needs elements whose force follows straight lines, and these have curved laws: {names}; "
                f"{instead}"
            )

    def require_kinds(self, method: str, kinds: Collection[int], where: str) -> None:
        """Raises InputError where a method whose file is `where` meets a law whose number is not among `kinds`."""
        if names := self._with_law(lambda kind: kind not in kinds):
            raise InputError(f"{method} has not the law of {names}: write it in {where}, or ask another method")

    def _with_law(self, has: Callable[[int], bool]) -> str:
        """Names of the elements of which that is true of the number of their law."""
        kinds = () if self.laws is None else self.laws.kind
        return ", ".join(name for name, kind in zip(self.element_names, kinds, strict=False) if has(kind))

    def compression(self, x: np.ndarray, lift: np.ndarray | float) -> np.ndarray:
        """Compression of every element [m], shape (..., e), for positions x (..., n) [m] and lift (...) [m]."""
        padded = np.concatenate([x, np.zeros((*x.shape[:-1], 1))], axis=-1)  # index -1 reads the ground
        d = padded[..., self.a] - padded[..., self.b] - self.gap
        return d + self.cam_driven * np.asarray(lift)[..., None]


def kept_with_train(of_train: Callable[[Train], Computed]) -> Callable[[Train], Computed]:
    """A function of a train that is computed once for each, and kept for as long as that train is: a search for a yield
    comes back to thousands of drawn ones with every cam, and its statement leaves each at once."""
    kept = WeakKeyDictionary[Train, Computed]()

    @wraps(of_train)
    def computed(train: Train) -> Computed:
        if train not in kept:
            kept[train] = of_train(train)
        return kept[train]

    return computed


def build_train(scene: Scene) -> Train:
    """The SI arrays of a scene, whose names must already be checked (see `camopt.scene.load`). The same scene gives the
    same train, for which what is kept by train, such as propagators, is made once."""
    return _built(SceneKey(scene))


class SceneKey:
    """A scene as the key of a cache: by identity, since comparing all its numbers takes longer than building."""

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
    """Elements on the way from the cam-driven one to the valve; no way leads over the ground."""
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
                other = int(b[e] if a[e] == mass else a[e])
                if other not in seen:
                    ways.append((other, (*path, e)))
    return ()
