"""Misspelt commands, options, words, scenes, cams and parameters: one sentence that names what was probably meant."""

import pytest

from tests.test_cli import run

SIMULATE = ("simulate", "kodama", "--cam", "polydyne", "--speed", "6000")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("optimise",), "no command 'optimise'; did you mean 'optimize'?"),
        (("simulate", "kodama", "--cam", "polydyne", "--sped", "6000"), "no option '--sped'; did you mean '--speed'?"),
        (("optimize", "--acuracy=draft"), "no option '--acuracy'; did you mean '--accuracy'?"),
        (("optimize", "--accuracy", "daft"), "'daft': expected draft, standard or fine; did you mean 'draft'?"),
        (("verify", "kodama", "--cam", "polydyne", "--accuracy", "fien"), "did you mean 'fine'?"),
        ((*SIMULATE, "--method", "rgk"), "did you mean 'rkg'?"),
        (("modes", "kodma"), "did you mean 'kodama'?"),
        (("scenes", "Motori1"), "did you mean 'motori-1'?"),
        (("cam", "kodama", "--cam", "polydine"), "did you mean 'polydyne'?"),
        (("cam", "kodama", "--cam", "polydin:exponents=2/4"), "did you mean 'polydyne'?"),
        (("cam", "kodama", "--cam", "polydyne:exponent=2/4"), "did you mean 'exponents'?"),
        (("cam", "kodama", "--cam", "cycloidal:x=1"), "this family has none"),
    ],
)
def test_what_was_probably_meant(capsys, words, says):
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert says in err.splitlines()[-1]


def test_nothing_is_suggested_that_is_not_close(capsys):
    for words in (("zzz",), ("modes", "zzz"), ("optimize", "--zzz"), ("scenes", "zzz"), ("optimize", "--seed", "z")):
        code, _, err = run(capsys, *words)
        assert (code, "did you mean" in err) == (2, False)


def test_a_word_after_two_dashes_is_no_option(capsys):
    _, _, err = run(capsys, "modes", "--", "--state")
    assert "neither a built-in scene" in err


def test_an_empty_name_and_a_very_long_one_end_in_a_sentence(capsys):
    for name in ("", "k" * 100_000):
        code, _, err = run(capsys, "modes", name)
        assert code == 2 and len(err) < 400
