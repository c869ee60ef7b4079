"""Mutants drawn from a seed: Cosmic Ray's operators at every place of the files that they can change."""

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
"""Operators that need arguments, one that here removes `compiled`, which changes no result, and those from or to bits:
floats have none, so that every test would catch them, and annotations have `|`, where it is no fault."""
OPERATORS = {n: OperatorProvider()[n]() for n in OperatorProvider() if not any(part in n for part in LEFT_OUT)}


@dataclass(frozen=True)
class Mutant:
    """The `occurrence`-th place in a file, counted from 0, where an operator applies."""

    file: str
    operator: str
    occurrence: int

    @property
    def key(self) -> str:
        """What names it in a journal."""
        return "{file}:{operator}:{occurrence}".format(**asdict(self))

    def text(self) -> str:
        """The file's text with the fault."""
        source = (ROOT / self.file).read_text(encoding="utf-8")
        changed = MutationVisitor.mutate_code(source, OPERATORS[self.operator], self.occurrence)
        if changed is None:
            raise ValueError(f"{self.key}: there is no such place")
        return changed


def mutants(seed: int) -> list[Mutant]:
    """All of them in an order that the seed draws."""
    found = []
    for folder in MUTATED:
        for path in sorted((ROOT / "camopt" / folder).rglob("*.py")):
            nodes = list(ast_nodes(get_ast(path.read_text(encoding="utf-8"))))
            for name, operator in OPERATORS.items():
                places = sum(len(list(operator.mutation_positions(node))) for node in nodes)
                found += [Mutant(path.relative_to(ROOT).as_posix(), name, i) for i in range(places)]
    Random(seed).shuffle(found)
    return found


def difference(mutant: Mutant, changed: str) -> tuple[str, range]:
    """The lines that differ, as a text and as numbers in the file without the fault."""
    known = (ROOT / mutant.file).read_text(encoding="utf-8").splitlines()
    lines = list(difflib.unified_diff(known, changed.splitlines(), n=0, lineterm=""))[2:]
    first, count = (int(q) for q in (lines[0].split()[1].removeprefix("-") + ",1").split(",")[:2])
    return "\n".join(lines), range(first, first + count)
