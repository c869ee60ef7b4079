"""Every verb of the command line prints and writes what it did: `python -m tests.golden` stores it anew."""

import re

import pytest

from tests.golden.commands import HERE, LONG, QUICK, answer

RELATIVE = 1e-5
"""Numbers may differ by this much of themselves. Another processor rounds sums of products otherwise, by 1e-16 of a
number, which searches, differences of neighbouring values and bouncing motions make larger: programs that are compiled
for a processor without fused products (NUMBA_CPU_NAME=generic) differ by up to 4e-6 here."""
ABSOLUTE = 1e-7
"""Differences below it, in the unit of the number, are such rounding where a number is small: there up to 7e-8."""
OF_GRADIENTS = 1e-6
"""The same of `camopt gradient`, whose errors are those of differences of neighbouring values."""
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w])")


def unit_of_last_place(number: str) -> float:
    """What the last printed decimal of a number counts; 0 for a number without decimals, which is a count."""
    mantissa, _, exponent = number.lower().partition("e")
    _, point, decimals = mantissa.partition(".")
    return 10.0 ** (int(exponent or 0) - len(decimals)) if point else 0.0


def is_close(stored: str, computed: str, absolute: float = ABSOLUTE) -> bool:
    """Whether two printed numbers agree, which may also be rounded to neighbouring decimals."""
    allowed = absolute + RELATIVE * abs(float(stored)) + 1.01 * unit_of_last_place(stored)
    return abs(float(stored) - float(computed)) <= allowed


def differing_lines(stored: str, computed: str, absolute: float = ABSOLUTE) -> list[str]:
    """The lines of a text whose words or numbers differ from the stored ones; [] where none do."""
    before, now = stored.splitlines(), computed.splitlines()
    different = [] if len(before) == len(now) else [f"{len(before)} lines were stored, there are {len(now)}"]
    for i, (old, new) in enumerate(zip(before, now, strict=False), start=1):
        if old == new:
            continue
        old_words, new_words = (" ".join(NUMBER.sub("#", line).split()) for line in (old, new))
        pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=False)
        if old_words != new_words or not all(is_close(*pair, absolute) for pair in pairs):
            different.append(f"line {i}:\n- {old}\n+ {new}")
    return different


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.long) for name in LONG)])
def test_a_command_answers_as_it_did(name, tmp_path):
    stored = (HERE / f"{name}.txt").read_text(encoding="utf-8")
    absolute = OF_GRADIENTS if name.endswith("gradient") else ABSOLUTE
    different = differing_lines(stored, answer((QUICK | LONG)[name], tmp_path), absolute)
    assert not different, "\n".join(different[:40])


def test_every_stored_answer_has_its_commands():
    assert {*QUICK} <= {path.stem for path in HERE.glob("*.txt")} <= {*QUICK, *LONG}


@pytest.mark.parametrize(
    ("stored", "computed"),
    [
        ("area 0.6019", "area 0.6022"),
        ("8 trains", "9 trains"),
        ("verdict: confirmed", "verdict: rejected"),
        ('"bounce_mm": 0.05123456789012345', '"bounce_mm": 0.05133456789012345'),
        ("one\ntwo", "one"),
    ],
)
def test_a_change_is_seen(stored, computed):
    assert differing_lines(stored, computed)


def test_rounding_is_no_change():
    assert not differing_lines("jump  0.050,  1.0000000000000002", "jump 0.051, 1.0")
