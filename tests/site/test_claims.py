"""Every claim names existing commands, and the results from which its numbers come."""

import re
import shlex
from pathlib import Path

import pytest

from camopt.cli.parser import parser
from docs.generators.claims import claims, stored_claims
from docs.generators.results import RESULTS, ROLE

ROOT = Path(__file__).parents[2]
CLAIMS = {claim["title"]: claim for claim in stored_claims()}


@pytest.mark.parametrize("title", CLAIMS)
def test_every_claim_names_commands_that_exist(title):
    assert CLAIMS[title]["commands"]
    for command in CLAIMS[title]["commands"]:
        words = shlex.split(command)
        for name in [w for w in words if w.startswith(("tests/", "experiments."))]:
            path = name if name.startswith("tests/") else name.replace(".", "/") + ".py"
            assert (ROOT / path).exists(), command
        if words[0] == "camopt":
            assert parser().parse_args(words[1:]).command


@pytest.mark.parametrize("title", CLAIMS)
def test_every_claim_names_the_results_of_its_numbers(title):
    expressions = " ".join(ROLE.findall(CLAIMS[title]["measured"]))
    used = {path.stem for path in RESULTS.glob("*.json") if re.search(rf"(?<![\w.]){path.stem}[.\[]", expressions)}
    assert used <= set(CLAIMS[title].get("results", []))
    for name in CLAIMS[title].get("results", []):
        assert any(name in command for command in CLAIMS[title]["commands"]), name


def test_the_page_has_every_claim_once():
    page = (ROOT / "docs" / "validation" / "claims.md").read_text(encoding="utf-8")
    groups = re.findall(r"```\{generated\} claims\n(\w+)\n```", page)
    assert len(groups) == len(set(groups)) and set(groups) == {claim["group"] for claim in CLAIMS.values()}
    shown = "".join(claims(group) for group in groups)
    assert all(shown.count(f"### {title}\n") == 1 for title in CLAIMS)
    assert "Measured 20" in shown and "on x86_64" in shown
