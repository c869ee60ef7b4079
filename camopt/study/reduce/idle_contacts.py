"""Contacts that are left out of a model because they never switch.

They are monitored in every revolution, and a run in which one of them would switch is refused. The seat and the
contacts between cam and valve are never left out, because the metrics use them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from camopt.measure.hermite import Hermite
from camopt.scene import MotionRefused, Response, Scene, Train, build_train
from camopt.scene.laws import CONTACT_LAWS
from camopt.scene.response import Revolve
from camopt.scene.units import DEG


@dataclass(frozen=True)
class LeftOut:
    """A scene without its idle contacts, and the train that monitors them."""

    scene: Scene  # without contacts that never closed; those that never opened are bilateral springs
    open: tuple[str, ...] = ()  # names of contacts that stayed open
    closed: tuple[str, ...] = ()  # names of contacts that stayed closed
    watched: Train | None = None  # the masses of `scene` with only these contacts; None: nothing is left out

    def prepare(self, method: Callable[..., Revolve], *arguments) -> Revolve:
        """A method's revolution of this scene, with the `arguments` of the method's own `prepare`. It raises
        MotionRefused as `check` does, and has no unsampled `advance`, so that every revolution is monitored."""
        revolve = method(*arguments)
        if self.watched is None:
            return revolve

        def watched(state: np.ndarray) -> Response:
            response = revolve(state)
            self.check(response)
            return response

        return watched

    def check(self, response: Response) -> None:
        """Raises MotionRefused, naming contact, angle and speed, where an omitted contact would have switched."""
        t = self.watched
        if t is None:
            return
        for e, name in enumerate(t.element_names):
            beyond = response.x @ t.incidence[e] - (t.gap[e] + t.touch_compression[e])
            rate = response.v @ t.incidence[e]
            if name in self.open:
                compression = Hermite(response.angle, beyond, rate / response.cam_speed)
                switched = compression.positive_spans(response.angle[0], response.angle[-1])[:, 0]
            else:
                depth = beyond + t.touch_compression[e]
                elastic = t.stiffness[e] * beyond if t.laws is None else t.laws.along(e, depth, t.preload[e])[0]
                switched = response.angle[elastic + t.damping[e] * rate <= 0.0]
            if len(switched):
                angle = (switched[0] / DEG + 180.0) % 360.0 - 180.0
                raise MotionRefused(
                    f"model {self.scene.name}: contact {name!r} is left out as never "
                    f"{'closing' if name in self.open else 'opening'}, and would at {angle:.1f} deg and "
                    f"{response.cam_speed * 30 / np.pi:g} cam r/min: simulate the scene that has it"
                )


def idle_contacts(responses: Sequence[Response]) -> tuple[frozenset[str], frozenset[str]]:
    """Names of the contacts that carry no force in any of the records, and of those that always carry some."""
    train, force = responses[0].train, np.concatenate([response.force for response in responses])
    candidates = [e for e in np.flatnonzero(train.contact) if e != train.seat and e not in train.cam_side]
    never = frozenset(train.element_names[e] for e in candidates if force[:, e].max() <= 0.0)
    always = frozenset(train.element_names[e] for e in candidates if force[:, e].min() > 0.0)
    return never, always


def leave_out(scene: Scene, never_closed: frozenset[str], never_open: frozenset[str]) -> LeftOut:
    """The scene without the contacts `never_closed` and with those `never_open` as springs; both are monitored.

    An element with a law that only contacts have remains a contact.
    """
    never_open = frozenset(e.name for e in scene.element if e.name in never_open and e.law not in CONTACT_LAWS)
    if not never_closed | never_open:
        return LeftOut(scene)
    elements = tuple(
        e.model_copy(update={"kind": "spring"}) if e.name in never_open else e
        for e in scene.element
        if e.name not in never_closed
    )
    idle = tuple(e for e in scene.element if e.name in never_closed | never_open)
    watched = build_train(scene.model_copy(update={"element": idle, "valve": None, "seat": None}))
    without = scene.model_copy(update={"element": elements})
    return LeftOut(without, tuple(sorted(never_closed)), tuple(sorted(never_open)), watched)
