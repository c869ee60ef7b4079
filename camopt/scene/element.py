"""The table [[element]] of a scene: the keys of each kind and law of element, and the values that they may have."""

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from camopt.scene.laws import CONTACT_LAWS, DISSIPATION
from camopt.scene.table import SMALLEST, Name, NonNegative, Positive, Table
from camopt.scene.units import MM

LAWS = ("linear", *CONTACT_LAWS, "progressive", "table")
FORMS = (*LAWS, "adjuster", "friction")
"""The laws of springs and contacts, and the two kinds of element that have a law of their own."""
OF_CONTACT_LAWS = {
    key: tuple(name for name, law in CONTACT_LAWS.items() if key in law.keys)
    for key in dict.fromkeys(key for law in CONTACT_LAWS.values() for key in law.keys)
}
"""Key of a contact law -> the contact laws that have it."""
BELONGS = {
    "stiffness_N_per_m": ("linear", *CONTACT_LAWS, "adjuster", "friction"),
    **OF_CONTACT_LAWS,
    "stiffness_table": ("progressive",),
    "force_table": ("table",),
    "leak_N_s_per_m": ("adjuster",),
    "spring_N_per_m": ("adjuster",),
    "stroke_mm": ("adjuster",),
    "check_travel_mm": ("adjuster",),
    "slip_N": ("friction",),
}
"""Key -> the forms of element (see `FORMS`) that have it."""
OPTIONAL = ("check_travel_mm", *(law.key for law in CONTACT_LAWS.values() if law.usual is not None))
"""Keys of `BELONGS` that may be left out."""
ROWS = {
    "stiffness_table": "[compression_mm, stiffness_N_per_m]",
    "force_table": "[compression_mm, force_N]",
}
NOT_OF = {
    "damping_N_s_per_m": (("adjuster", "friction", *OF_CONTACT_LAWS[DISSIPATION]), "the law itself dissipates energy"),
    "gap_mm": (("adjuster", "friction"), "it has no lash"),
    "preload_N": (("friction", "table"), "its force is all in its law"),
}
"""Key -> the forms of element for which it must be zero, and the reason."""
MOST_TABLE_ROWS = 200
NEAREST_MM, FURTHEST_MM = 1e-6, 500.0
"""Least and largest distance [mm] of neighbouring rows: closer ones are one row, and no spring travels half a metre."""
StiffnessTable = Annotated[tuple[tuple[float, Positive], ...], Field(min_length=2, max_length=MOST_TABLE_ROWS)]
ForceTable = Annotated[tuple[tuple[float, float], ...], Field(min_length=2, max_length=MOST_TABLE_ROWS)]


class Element(Table, frozen=True):
    """A spring, a contact, an adjuster or a friction element, between two masses or between a mass and the ground.

    A "spring" pushes and pulls; a "contact" only pushes. `preload_N` is the elastic force at zero compression. `law`
    states how the elastic force depends on the compression (see `camopt.scene.laws`):

    - Under "linear" it grows by `stiffness_N_per_m`.
    - Under "hertz", which only contacts may have, it is `stiffness_N_per_m` [N/m^exponent] times the compression to the
      power `exponent` (1.5 if left out).
    - Under "hunt-crossley", which only contacts may have, that elastic force is multiplied by 1 + `dissipation_s_per_m`
      times the rate of compression [m/s] (Hunt and Crossley 1975), and is never negative. Such a contact has no
      separate damper. For steel the dissipation is 0.12 to 0.48 s/m: it is 3/2 of the source's alpha, where the
      coefficient of restitution of a slow impact is 1 - alpha times its speed.
    - Under "progressive" the stiffness is a function of the compression, given by `stiffness_table` with rows of
      [compression_mm, stiffness_N_per_m].
    - Under "table" the force is interpolated linearly between the rows [compression_mm, force_N] of `force_table`, and
      extrapolated beyond them. Compressions count from the closed valve. If they were measured from the free length, as
      on a spring tester, `installed_mm` is the compression at which the valve is closed.

    The compressions in the rows of a table must ascend.

    An "adjuster" is a hydraulic lash adjuster, installed in the middle of its `stroke_mm`. It consists of a plunger
    spring, with the rate `spring_N_per_m` and the preload `preload_N`, and of a parallel oil column with the stiffness
    `stiffness_N_per_m`. The oil leaks under the force `leak_N_s_per_m` per m/s of leaking down, and refills without
    force. The ball of its check valve travels by `check_travel_mm` before it shuts. Its stops are as stiff as the oil.

    A "friction" element sticks, with the stiffness `stiffness_N_per_m`, until its force reaches `slip_N`, and then
    slides (Jenkins 1962).
    """

    name: Name
    kind: Literal["spring", "contact", "adjuster", "friction"]
    between: tuple[str, str]
    law: Literal[LAWS] = "linear"  # pyright: ignore[reportInvalidTypeForm]
    stiffness_N_per_m: Positive | None = Field(default=None, validate_default=True)
    exponent: Annotated[float, Field(ge=1, le=3)] | None = None
    dissipation_s_per_m: Positive | None = Field(default=None, validate_default=True)
    stiffness_table: StiffnessTable | None = Field(default=None, validate_default=True)
    force_table: ForceTable | None = Field(default=None, validate_default=True)
    installed_mm: NonNegative = Field(default=0.0, validate_default=False)
    leak_N_s_per_m: Positive | None = Field(default=None, validate_default=True)
    spring_N_per_m: Positive | None = Field(default=None, validate_default=True)
    stroke_mm: Positive | None = Field(default=None, validate_default=True)
    check_travel_mm: NonNegative | None = None
    slip_N: Positive | None = Field(default=None, validate_default=True)
    damping_N_s_per_m: NonNegative = 0.0
    preload_N: float = 0.0
    gap_mm: NonNegative = 0.0
    cam_driven: bool = False
    assumed: tuple[str, ...] = ()
    source: str = ""

    @property
    def form(self) -> str:
        """The law of a spring or contact, or the kind of any other element; see `FORMS`."""
        return self.law if self.kind in ("spring", "contact") else self.kind

    @field_validator("law")
    @classmethod
    def _law_of_the_kind(cls, law, info: ValidationInfo):
        kind = info.data.get("kind")
        if law in CONTACT_LAWS and kind == "spring":
            raise ValueError(f'"{law}" is a law of contacts: a spring may be "linear", "progressive" or "table"')
        if law != "linear" and kind in ("adjuster", "friction"):
            raise ValueError(f'kind = "{kind}" has a law of its own: leave this key out')
        return law

    @field_validator(*BELONGS)
    @classmethod
    def _of_this_form(cls, value, info: ValidationInfo):
        key, form = info.field_name, _form(info)
        if form is None or key is None:
            if key == "stiffness_N_per_m" and value is None and info.data.get("law") in BELONGS[key]:
                raise ValueError("missing")  # whatever the kind should be, it has a stiffness
            return value
        if value is None and form in BELONGS[key] and key not in OPTIONAL:
            raise ValueError(f"missing; give rows of {ROWS[key]}" if key in ROWS else "missing")
        if value is not None and form not in BELONGS[key]:
            if key == "stiffness_N_per_m":
                rows = next(key for key in ROWS if form in BELONGS[key])
                raise ValueError(f'law "{form}" takes its stiffness from {rows}: leave this key out')
            what = "kind" if BELONGS[key][0] in ("adjuster", "friction") else "law"
            owners = " or ".join(f'"{form}"' for form in BELONGS[key])
            raise ValueError(f"belongs to {what} = {owners}, and only to {'it' if len(BELONGS[key]) == 1 else 'these'}")
        return value

    @field_validator(*ROWS)
    @classmethod
    def _ascending(cls, table, info: ValidationInfo):
        if table is None:
            return table
        compressions, values = zip(*table, strict=True)
        if any(a >= b for a, b in pairwise(compressions)):
            raise ValueError("the compressions of its rows must ascend without repeats")
        if any(not NEAREST_MM <= b - a <= FURTHEST_MM for a, b in pairwise(compressions)):
            raise ValueError(f"neighbouring compressions must be {NEAREST_MM:g} to {FURTHEST_MM:g} mm apart")
        if info.field_name == "force_table":
            if any(a >= b for a, b in pairwise(values)):
                raise ValueError(
                    "the forces of its rows must ascend without repeats: a spring that is pressed pushes more"
                )
            if any(_stiffness(a, b) < SMALLEST for a, b in pairwise(table)):
                raise ValueError(f"the stiffness from row to row must be at least {SMALLEST:g} N/m")
        return table

    @field_validator("installed_mm")
    @classmethod
    def _inside_the_table(cls, installed, info: ValidationInfo):
        rows = info.data.get("force_table")
        if installed and _form(info) != "table":
            raise ValueError('belongs to law = "table", and only to it')
        if installed and rows and not rows[0][0] <= installed <= rows[-1][0]:
            ends = f"{rows[0][0]:g} to {rows[-1][0]:g} mm"
            raise ValueError(f"must lie in force_table, from {ends}: the compression with the valve closed")
        return installed

    @field_validator("spring_N_per_m")
    @classmethod
    def _softer_than_the_oil(cls, spring, info: ValidationInfo):
        stiffness = info.data.get("stiffness_N_per_m")
        if spring and stiffness and spring >= stiffness:
            raise ValueError(
                f"must be less than stiffness_N_per_m, which is {stiffness:g}: oil is stiffer than a spring"
            )
        return spring

    @field_validator("preload_N")
    @classmethod
    def _preload_of_the_form(cls, preload, info: ValidationInfo):
        form, data = _form(info), info.data
        if preload < 0 and form in CONTACT_LAWS:
            raise ValueError(f'must not be negative with law = "{form}": a contact that touches later has a gap_mm')
        if form == "adjuster" and data.get("spring_N_per_m") and data.get("stroke_mm"):
            least = data["spring_N_per_m"] * data["stroke_mm"] / 2000.0
            if preload <= least:
                raise ValueError(
                    f"must be more than spring_N_per_m times half of stroke_mm, which is {least:g} N: the plunger "
                    f"spring pushes as far as the plunger travels"
                )
            if data.get("stiffness_N_per_m") and preload / data["stiffness_N_per_m"] > FURTHEST_MM * MM:
                raise ValueError(f"presses the oil in by more than {FURTHEST_MM:g} mm: check the unit in the key")
        return preload

    @field_validator(*NOT_OF)
    @classmethod
    def _zero_where_it_means_nothing(cls, value, info: ValidationInfo):
        form, (forms, why) = _form(info), NOT_OF[info.field_name or ""]
        if value != 0.0 and form in forms:
            what = f'law = "{form}"' if form in LAWS else f'kind = "{form}"'
            raise ValueError(f"does not apply to {what}: {why}; leave this key out")
        return value

    @field_validator("cam_driven")
    @classmethod
    def _driven_contact(cls, driven, info: ValidationInfo):
        if driven and info.data.get("kind") in ("adjuster", "friction"):
            raise ValueError("the cam drives a contact: put one between the cam and this element")
        return driven


def _stiffness(row: tuple[float, float], following: tuple[float, float]) -> float:
    """Stiffness [N/m] between two neighbouring rows of a force table."""
    return (following[1] - row[1]) / ((following[0] - row[0]) * MM)


def _form(info: ValidationInfo) -> str | None:
    """`Element.form` from the keys validated so far; None if the kind or the law is faulty."""
    kind, law = info.data.get("kind"), info.data.get("law")
    return law if kind in ("spring", "contact") else kind
