"""The size of the package may not grow: `size.json` has, by folder, the numbers that must not be exceeded.

`python -m tests.test_size` lowers them to the measured numbers; with `--all` it also raises those that are exceeded.
`python -m tests.test_size --table FOLDER` compares the package of another checkout with this one.
"""

import ast
import io
import json
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

import camopt

ROOT = Path(camopt.__file__).parents[1]
TABLE = Path(__file__).with_name("size.json")
FEWEST_LINES = 10
"""A file with fewer lines could be part of the file that imports it."""
ALSO_COUNTED = ("tests", "experiments", "docs", "notebooks")
"""Folders outside the package, in which only lines are counted."""
GENERATED = ROOT / "docs" / "notebooks"
"""A folder that building the site creates; it is in no commit."""


@cache
def texts(root: Path) -> dict[Path, str]:
    """The files of a checkout's package by their path within the checkout."""
    return {p.relative_to(root): p.read_text(encoding="utf-8") for p in sorted((root / "camopt").rglob("*.py"))}


@cache
def nodes(text: str) -> tuple[ast.AST, ...]:
    """All syntax nodes of a file."""
    return tuple(ast.walk(ast.parse(text)))


def folder(path: Path) -> str:
    """The folder of the package that contains a file; files outside the folders belong to `root`."""
    return path.parts[1] if len(path.parts) > 2 else "root"


def line_count(text: str) -> int:
    return len(text.splitlines())


def name_of(node: ast.AST) -> str:
    match node:
        case ast.Name():
            return node.id
        case ast.Attribute():
            return node.attr
        case ast.alias():
            return node.name.rpartition(".")[2]
    return ""


Places = dict[str, Path]
"""Names, each with the file that contains it."""


def small_files(root: Path) -> Places:
    return {str(path): path for path, text in texts(root).items() if line_count(text) < FEWEST_LINES}


def classes_of_one_place(root: Path) -> Places:
    """Classes that are built by a single call and whose name no other file mentions."""
    built: Counter[str] = Counter()
    mentions: dict[str, set[Path]] = defaultdict(set)
    homes = {}
    for path, text in texts(root).items():
        for node in nodes(text):
            if isinstance(node, ast.ClassDef):
                homes[node.name] = path
            elif isinstance(node, ast.Call):
                built[name_of(node.func)] += 1
            if isinstance(node, ast.Name | ast.Attribute | ast.alias):
                mentions[name_of(node)].add(path)
    return {f"{home}: {name}": home for name, home in homes.items() if built[name] == 1 and mentions[name] <= {home}}


def modules_with_one_importer(root: Path) -> Places:
    """Modules that exactly one other file imports, by a statement or by a dotted name in a string."""
    paths = {".".join(path.with_suffix("").parts).removesuffix(".__init__"): path for path in texts(root)}
    importers: dict[str, set[Path]] = defaultdict(set)
    for path, text in texts(root).items():
        for node in nodes(text):
            if isinstance(node, ast.ImportFrom):
                names = {f"{node.module}.{alias.name}" for alias in node.names} | {str(node.module)}
            elif isinstance(node, ast.Import):
                names = {alias.name for alias in node.names}
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                names = {node.value.partition(":")[0]}
            else:
                continue
            for name in names & paths.keys():
                importers[name].add(path)
    alone = (paths[name] for name, those in importers.items() if len(those - {paths[name]}) == 1)
    return {str(path): path for path in alone if path.name != "__init__.py"}


def largest_files(root: Path) -> Places:
    """All files with their numbers of lines, the longest first."""
    ranked = sorted(texts(root).items(), key=lambda file: -line_count(file[1]))
    return {f"{path} ({line_count(text)})": path for path, text in ranked}


OFFENDERS: dict[str, Callable[[Path], Places]] = {
    "files": largest_files,
    "files under ten lines": small_files,
    "classes built at one place and used in one file": classes_of_one_place,
    "modules with one importer": modules_with_one_importer,
}


def lines_by_folder(root: Path) -> Counter[str]:
    lines: Counter[str] = Counter()
    for path, text in texts(root).items():
        lines[folder(path)] += line_count(text)
    return lines


@cache
def measured() -> dict[str, dict[str, int]]:
    """All counts, by kind and folder."""
    lines = lines_by_folder(ROOT)
    counts = {}
    for kind, places in OFFENDERS.items():
        offenders = Counter(map(folder, places(ROOT).values()))
        counts[kind] = {name: offenders[name] for name in lines}
    for name in ALSO_COUNTED:
        files = (path for path in (ROOT / name).rglob("*.py") if GENERATED not in path.parents)
        lines[name] = sum(line_count(path.read_text(encoding="utf-8")) for path in files)
    return {"lines": dict(lines)} | counts


def code_lines(text: str) -> int:
    """Number of lines with code, without comments, docstrings and blank lines."""
    blank = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    tokens = [token for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in blank]
    docstrings = {
        line
        for node in nodes(text)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    return len({line for token in tokens for line in range(token.start[0], token.end[0] + 1)} - docstrings)


def is_record(node: ast.ClassDef) -> bool:
    """Whether a class is a dataclass, a named tuple or a pydantic model."""
    decorators = [name_of(d.func if isinstance(d, ast.Call) else d) for d in node.decorator_list]
    return "dataclass" in decorators or bool({"NamedTuple", "BaseModel"} & {name_of(base) for base in node.bases})


def constants(text: str) -> int:
    """Number of names in capitals that a module assigns."""
    set_here = [node for node in ast.parse(text).body if isinstance(node, ast.Assign | ast.AnnAssign)]
    targets = [target for node in set_here for target in getattr(node, "targets", None) or [node.target]]
    return sum(name_of(target).isupper() for target in targets)


def house(root: Path) -> dict[str, int]:
    """Total counts of a checkout's package, and the lines of its folders."""
    files, lines = texts(root).values(), lines_by_folder(root)
    every = [node for text in files for node in nodes(text)]
    classes = [node for node in every if isinstance(node, ast.ClassDef)]
    functions = [node for node in every if isinstance(node, ast.FunctionDef)]
    mentioned = Counter(name_of(node) for node in every if isinstance(node, ast.Name | ast.Attribute | ast.alias))
    return {
        "lines": lines.total(),
        "code lines": sum(map(code_lines, files)),
        "files": len(files),
        "files under ten lines": len(small_files(root)),
        "classes": len(classes),
        "records": sum(map(is_record, classes)),
        "functions": len(functions),
        "functions mentioned once": sum(mentioned[function.name] == 1 for function in functions),
        "modules with one importer": len(modules_with_one_importer(root)),
        "constants": sum(map(constants, files)),
    } | {f"lines of {name}": lines[name] for name in sorted(lines)}


def allowed() -> dict[str, dict[str, int]]:
    return json.loads(TABLE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", ["lines", *OFFENDERS])
def test_no_count_exceeds_its_limit(kind):
    limits = allowed()[kind]
    exceeded = {name: count for name, count in measured()[kind].items() if count > limits.get(name, 0)}
    places = OFFENDERS.get(kind, largest_files)(ROOT)
    lines = [
        f"{name}: {count} {kind}, {limits.get(name, 0)} allowed: "
        f"{', '.join([place for place, path in places.items() if folder(path) == name][:20])}"
        for name, count in exceeded.items()
    ]
    remedy = (
        "cut as much elsewhere; for a new feature `python -m tests.test_size --all` raises them, and its commit says so"
    )
    assert not exceeded, "\n".join([*lines, remedy])


def lowered(limits: dict[str, dict[str, int]], numbers: dict[str, dict[str, int]]) -> dict[str, dict[str, int]]:
    """The smaller of the stored and the measured number; for a new folder the measured number."""
    return {
        kind: {name: min(count, limits.get(kind, {}).get(name, count)) for name, count in sorted(counts.items())}
        for kind, counts in numbers.items()
    }


def test_renewing_raises_no_limit():
    assert lowered({"lines": {"cam": 5}}, {"lines": {"cam": 7, "exact": 3}}) == {"lines": {"cam": 5, "exact": 3}}
    assert lowered({"lines": {"cam": 5}}, {"lines": {"cam": 4}}) == {"lines": {"cam": 4}}


def test_the_counts_of_a_checkout(tmp_path):
    package = tmp_path / "camopt" / "cam"
    package.mkdir(parents=True)
    (package / "one.py").write_text(
        '''"""Text."""\n\nfrom dataclasses import dataclass\n\nLENGTH = 1\n"""More."""\nwide = 2\n\n\n@dataclass\n'''
        "class Part:\n    size: int  # of it\n\n    # a comment\n    def twice(self):\n        return 2 * self.size\n"
        "\n\nclass Alone: ...\n\n\nalone = Alone()\n"
    )
    (package / "two.py").write_text("from camopt.cam.one import Part\n\nPart(1).twice()\n")
    wanted = {"lines": 25, "code lines": 12, "files": 2, "files under ten lines": 1, "classes": 2, "records": 1}
    wanted |= {"functions": 1, "functions mentioned once": 1, "modules with one importer": 1, "constants": 1}
    assert house(tmp_path) == wanted | {"lines of cam": 25}
    assert [*small_files(tmp_path)] == ["camopt/cam/two.py"]
    assert [*classes_of_one_place(tmp_path)] == ["camopt/cam/one.py: Alone"]
    assert [*modules_with_one_importer(tmp_path)] == ["camopt/cam/one.py"]


def main(words: list[str]) -> None:
    if words[:1] == ["--table"]:
        before, after = house(Path(words[1]).resolve()), house(ROOT)
        for name in before | after:
            print(f"{name:<28}{before.get(name, 0):>8,}{after.get(name, 0):>8,}")
        return
    before = {} if "--all" in words else allowed()
    TABLE.write_text(json.dumps(lowered(before, measured()), indent=2) + "\n", encoding="utf-8")
    print(f"{TABLE.name} is renewed")


if __name__ == "__main__":
    main(sys.argv[1:])
