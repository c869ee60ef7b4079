"""Laws of contacts that are curves: one file each, of which every path of camopt but the verifier's methods reads."""

from functools import cache
from importlib import import_module

from camopt.scene.contact_laws.record import ContactLaw, LawNumbers

CONTACT_LAWS = {
    "hertz": "camopt.scene.contact_laws.hertz:LAW",
    "hunt-crossley": "camopt.scene.contact_laws.hunt_crossley:LAW",
}
"""Every law of contacts by its name in a scene file, and where its record stands."""
DISSIPATION = "dissipation_s_per_m"
"""The key of a law that loses energy by itself, and takes no damper beside it."""
POINT_CONTACT = 1.5
"""Exponent of a law of contacts where the scene gives none."""


@cache
def contact_law(name: str) -> ContactLaw:
    """The record of a law by its name in `CONTACT_LAWS`."""
    module, _, record = CONTACT_LAWS[name].partition(":")
    return getattr(import_module(module), record)


def laws_with(key: str) -> tuple[str, ...]:
    """Names of the laws of contacts to which a key of an element belongs."""
    return tuple(name for name in CONTACT_LAWS if key in contact_law(name).keys)


__all__ = ["CONTACT_LAWS", "DISSIPATION", "POINT_CONTACT", "ContactLaw", "LawNumbers", "contact_law", "laws_with"]
