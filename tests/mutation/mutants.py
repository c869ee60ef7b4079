"""Mutants in an order drawn from a seed: Cosmic Ray's operators at every applicable place of the files."""

import difflib
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import MutationVisitor
from cosmic_ray.operators.provider import OperatorProvider

ROOT = Path(__file__).parents[2]
MUTATED = ("exact", "measure", "verifier", "optimizer/program")
LEFT_OUT = ("VariableReplacer", "VariableInserter", "RemoveDecorator", "Bit", "Shift")
"""Excluded operators: those that need arguments; the one that would remove `compiled`, which changes no result; and
bitwise ones, which fail on floats in every test, and which change `|` in annotations, where it is not a fault."""
OPERATORS = {n: OperatorProvider()[n]() for n in OperatorProvider() if not any(part in n for part in LEFT_OUT)}


@dataclass(frozen=True)
class Mutant:
    """The `occurrence`-th place in a file, counted from 0, where an operator applies."""

    file: str
    operator: str
    occurrence: int

    @property
    def key(self) -> str:
        """The name of the mutant in a journal."""
        return "{file}:{operator}:{occurrence}".format(**asdict(self))

    def text(self) -> str:
        """The file's text with the fault."""
        source = (ROOT / self.file).read_text(encoding="utf-8")
        changed = MutationVisitor.mutate_code(source, OPERATORS[self.operator], self.occurrence)
        if changed is None:
            raise ValueError(f"{self.key}: there is no such place")
        return changed


def mutants(seed: int) -> list[Mutant]:
    """All mutants, in a random order from the seed."""
    drawn = []
    for folder in MUTATED:
        for path in sorted((ROOT / "camopt" / folder).rglob("*.py")):
            file, nodes = path.relative_to(ROOT).as_posix(), list(ast_nodes(get_ast(path.read_text(encoding="utf-8"))))
            for name in OPERATORS:
                drawn += [Mutant(file, name, i) for i in range(len(_lines(nodes, name)))]
    Random(seed).shuffle(drawn)
    return drawn


def _lines(nodes: list, operator: str) -> list[int]:
    """The lines at which an operator applies, in the order of its occurrences."""
    return [start[0] for node in nodes for start, _ in OPERATORS[operator].mutation_positions(node)]


def mutants_with(file: str, operator: str, change: str) -> list[Mutant]:
    """The mutants of a file with this difference, ignoring line numbers, which change with other edits of the file."""
    text = (ROOT / file).read_text(encoding="utf-8") if (ROOT / file).exists() else ""
    lost = {line[1:] for line in change.splitlines() if line.startswith("-")}
    at = {number for number, line in enumerate(text.splitlines(), 1) if line in lost}
    places = [
        Mutant(file, operator, i) for i, k in enumerate(_lines(list(ast_nodes(get_ast(text))), operator)) if k in at
    ]
    return [mutant for mutant in places if bare(difference(mutant, mutant.text())[0]) == bare(change)]


def bare(change: str) -> str:
    """A difference without its line numbers."""
    return "\n".join(line for line in change.splitlines() if line and not line.startswith("@@"))


def difference(mutant: Mutant, changed: str) -> tuple[str, range]:
    """The difference as text, and the numbers of the changed lines in the original file."""
    original = (ROOT / mutant.file).read_text(encoding="utf-8").splitlines()
    lines = list(difflib.unified_diff(original, changed.splitlines(), n=0, lineterm=""))[2:]
    first, count = (int(q) for q in (lines[0].split()[1].removeprefix("-") + ",1").split(",")[:2])
    return "\n".join(lines), range(first, first + count)
