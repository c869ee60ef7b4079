"""Tables of a train: they grow where a motion meets more combinations of pieces, and only so much memory is kept."""

import numpy as np

from camopt import load_scene, polydyne
from camopt.exact import prepare
from camopt.exact.engine import AT_ONCE
from camopt.exact.kernel import propagators as module
from camopt.exact.kernel.revolution import TABLES_FULL
from camopt.scene.rest import state_at_rest
from camopt.scene.train import build_train


def test_a_motion_is_the_same_where_its_tables_had_to_grow(monkeypatch):
    scene = load_scene("motori-1")
    lift, speed = polydyne(scene), scene.cam_speed(5000)

    def after() -> np.ndarray:
        train = build_train(scene)  # with tables of its own
        return prepare(train, lift, speed).advance(state_at_rest(train), 3)

    with_room = after()
    monkeypatch.setattr(module, "FIRST_COMBINATIONS", 1)
    np.testing.assert_array_equal(after(), with_room)


def test_what_is_written_stays_where_tables_grow():
    scene = load_scene("motori-1")
    train, lift = build_train(scene), polydyne(scene)
    motion = prepare(train, lift, scene.cam_speed(5000))
    motion.advance(state_at_rest(train))
    with motion._lent(AT_ONCE) as own:
        before, room = own.tables, len(own.tables.keys)
        own.grow(TABLES_FULL)
        count = int(before.built[0])
        assert count > 1 and len(own.tables.keys) == module.GROWTH * room
        for name in ("keys", "count", "watch", "steps", "fine", "motion"):
            np.testing.assert_array_equal(getattr(own.tables, name)[:count], getattr(before, name)[:count])


def test_the_oldest_tables_go_where_others_would_exceed_the_memory(monkeypatch):
    train, step = build_train(load_scene("motori-1")), 1e-5
    monkeypatch.setattr(module, "_kept", type(module._kept)())
    first = module.propagators(train, step, 8, 2)
    with first.lent() as own:
        own.tables.built[0] = 1
    assert first.size > 0 and module.propagators(train, step, 8, 2) is first
    module.propagators(train, 2 * step, 8, 2)
    assert module.propagators(train, step, 8, 2) is first
    monkeypatch.setattr(module, "KEPT_BYTES", first.size - 1)
    module.propagators(train, 3 * step, 8, 2)
    assert module.propagators(train, step, 8, 2) is not first


def test_forgotten_tables_are_made_anew():
    train, step = build_train(load_scene("motori-1")), 1e-5
    first = module.propagators(train, step, 8, 2)
    module.forget_propagators()
    assert module.propagators(train, step, 8, 2) is not first
