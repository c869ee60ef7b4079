"""The size of the package may only shrink: `size.json` holds, by folder, the numbers that must not be exceeded.

`python -m tests.test_size` lowers them to what is measured; with `--all` it also raises those that have to rise.
`python -m tests.test_size --table FOLDER` prints what the package of another checkout has beside this one's.
"""

import ast
import json
import sys
import tokenize
from collections import Counter, defaultdict
from functools import cache
from pathlib import Path

import pytest

import camopt

PACKAGE = Path(camopt.__file__).parent
ROOT = PACKAGE.parent
TABLE = Path(__file__).with_name("size.json")
FEWEST_LINES = 10
"""A file with fewer lines could stand in the file that reads it."""
ALSO_COUNTED = ("tests", "experiments", "docs", "notebooks")
"""Folders beside the package of which only the lines are counted."""
GENERATED = ROOT / "docs" / "notebooks"
"""What the site is built from and no commit has."""


@cache
def trees() -> dict[Path, ast.Module]:
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}


def folder(path: Path) -> str:
    """The folder of the package that a file belongs to; files beside the folders belong to `root`."""
    first, *rest = path.relative_to(PACKAGE).parts
    return first if rest else "root"


def shown(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def line_count(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def small_files() -> dict[str, list[str]]:
    short = [p for p in trees() if line_count(p) < FEWEST_LINES]
    return by_folder({shown(p): p for p in short})


def classes_of_one_place() -> dict[str, list[str]]:
    """Classes that one call builds and whose name no other file mentions."""
    built: Counter[str] = Counter()
    mentions: dict[str, set[Path]] = defaultdict(set)
    homes = {}
    for path, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                homes[node.name] = path
            elif isinstance(node, ast.Call):
                built[name_of(node.func)] += 1
            if isinstance(node, ast.Name | ast.Attribute | ast.alias):
                mentions[name_of(node)].add(path)
    alone = {name: home for name, home in homes.items() if built[name] == 1 and mentions[name] <= {home}}
    return by_folder({f"{shown(home)}: {name}": home for name, home in alone.items()})


def name_of(node: ast.AST) -> str:
    match node:
        case ast.Name():
            return node.id
        case ast.Attribute():
            return node.attr
        case ast.alias():
            return node.name.rpartition(".")[2]
    return ""


def modules_with_one_importer() -> dict[str, list[str]]:
    """Modules that one other file imports, in a statement or by a dotted name in a string."""
    paths = {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in trees()}
    importers: dict[str, set[Path]] = defaultdict(set)
    for path, tree in trees().items():
        for node in ast.walk(tree):
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
    alone = {name: paths[name] for name, those in importers.items() if len(those - {paths[name]}) == 1}
    return by_folder({shown(path): path for path in alone.values() if path.name != "__init__.py"})


def by_folder(places: dict[str, Path]) -> dict[str, list[str]]:
    folders: dict[str, list[str]] = {folder(path): [] for path in trees()}
    for name, path in places.items():
        folders[folder(path)].append(name)
    return folders


def largest_files() -> dict[str, list[str]]:
    """The files of every folder, the longest first, each with its lines."""
    ranked = sorted(trees(), key=line_count, reverse=True)
    return by_folder({f"{shown(p)} ({line_count(p)})": p for p in ranked})


OFFENDERS = {
    "files": largest_files,
    "files under ten lines": small_files,
    "classes built at one place and used in one file": classes_of_one_place,
    "modules with one importer": modules_with_one_importer,
}


def lines_by_folder() -> Counter[str]:
    lines: Counter[str] = Counter()
    for path in trees():
        lines[folder(path)] += line_count(path)
    return lines


@cache
def measured() -> dict[str, dict[str, int]]:
    """Every number by what it counts and by folder."""
    lines = lines_by_folder()
    for name in ALSO_COUNTED:
        lines[name] = sum(line_count(p) for p in (ROOT / name).rglob("*.py") if GENERATED not in p.parents)
    counts = {kind: {f: len(names) for f, names in found().items()} for kind, found in OFFENDERS.items()}
    return {"lines": dict(lines)} | counts


def code_lines(path: Path) -> int:
    """Lines that hold more than a comment or a docstring."""
    text = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    docstrings = {
        line
        for node in ast.walk(trees()[path])
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    with path.open("rb") as file:
        used = [range(t.start[0], t.end[0] + 1) for t in tokenize.tokenize(file.readline) if t.type not in text]
    return len({line for lines in used[1:] for line in lines} - docstrings)


def is_record(node: ast.ClassDef) -> bool:
    """A dataclass, a named tuple or a model of pydantic."""
    decorators = [name_of(d.func if isinstance(d, ast.Call) else d) for d in node.decorator_list]
    return "dataclass" in decorators or bool({"NamedTuple", "BaseModel"} & {name_of(base) for base in node.bases})


def functions_mentioned_once(functions: list[ast.FunctionDef]) -> int:
    """Functions whose name stands in one further place of the package."""
    mentioned = Counter(
        name_of(node)
        for tree in trees().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.Name | ast.Attribute | ast.alias)
    )
    return sum(mentioned[function.name] == 1 for function in functions)


def house() -> dict[str, int]:
    """What the package has in all, and the lines of its folders."""
    nodes = [node for tree in trees().values() for node in ast.walk(tree)]
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    names = [
        name_of(target)
        for tree in trees().values()
        for statement in tree.body
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        for target in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
    ]
    lines = lines_by_folder()
    return {
        "lines": lines.total(),
        "code lines": sum(map(code_lines, trees())),
        "files": len(trees()),
        "files under ten lines": sum(map(len, small_files().values())),
        "classes": len(classes),
        "records": sum(map(is_record, classes)),
        "functions": len(functions),
        "functions mentioned once": functions_mentioned_once(functions),
        "modules with one importer": sum(map(len, modules_with_one_importer().values())),
        "constants": sum(name.isupper() for name in names),
    } | {f"lines of {name}": lines[name] for name in sorted(lines)}


def of_checkout(root: Path) -> dict[str, int]:
    """The same of another checkout."""
    global PACKAGE, ROOT
    here = PACKAGE, ROOT
    PACKAGE, ROOT = root / "camopt", root
    trees.cache_clear()
    try:
        return house()
    finally:
        PACKAGE, ROOT = here
        trees.cache_clear()


def allowed() -> dict[str, dict[str, int]]:
    return json.loads(TABLE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("kind", ["lines", *OFFENDERS])
def test_numbers_only_fall(kind):
    limits = allowed()[kind]
    exceeded = {name: count for name, count in measured()[kind].items() if count > limits.get(name, 0)}
    places = OFFENDERS.get(kind, largest_files)() if exceeded else {}
    said = [
        f"{name}: {count} {kind}, {limits.get(name, 0)} allowed: {', '.join(places.get(name, [])[:20])}"
        for name, count in exceeded.items()
    ]
    remedy = (
        "cut as much elsewhere; for a new feature `python -m tests.test_size --all` raises them, and its commit says so"
    )
    assert not exceeded, "\n".join([*said, remedy])


def lowered(limits: dict[str, dict[str, int]], numbers: dict[str, dict[str, int]]) -> dict[str, dict[str, int]]:
    """The smaller of the stored and the measured number; a folder that is new has what is measured."""
    return {
        kind: {name: min(count, limits.get(kind, {}).get(name, count)) for name, count in sorted(counts.items())}
        for kind, counts in numbers.items()
    }


def test_renewing_raises_no_number():
    assert lowered({"lines": {"cam": 5}}, {"lines": {"cam": 7, "exact": 3}}) == {"lines": {"cam": 5, "exact": 3}}
    assert lowered({"lines": {"cam": 5}}, {"lines": {"cam": 4}}) == {"lines": {"cam": 4}}


def test_the_house_of_another_checkout_is_counted(tmp_path):
    package = tmp_path / "camopt" / "cam"
    package.mkdir(parents=True)
    (package / "one.py").write_text(
        '''"""Text."""\n\nfrom dataclasses import dataclass\n\nLENGTH = 1\n"""More."""\nwide = 2\n\n\n@dataclass\n'''
        "class Part:\n    size: int  # of it\n\n    # a comment\n    def twice(self):\n        return 2 * self.size\n"
    )
    (package / "two.py").write_text("from camopt.cam.one import Part\n\nPart(1).twice()\n")
    counts = of_checkout(tmp_path)
    wanted = {"lines": 19, "code lines": 10, "files": 2, "files under ten lines": 1, "classes": 1, "records": 1}
    wanted |= {"functions": 1, "functions mentioned once": 1, "modules with one importer": 1, "constants": 1}
    assert counts == wanted | {"lines of cam": 19}
    assert PACKAGE == Path(camopt.__file__).parent


def test_a_small_file_a_lone_class_and_a_lone_importer_are_noticed(tmp_path, monkeypatch):
    package = tmp_path / "camopt" / "cam"
    package.mkdir(parents=True)
    body = "\n".join(f"x{i} = {i}" for i in range(12))
    (package / "one.py").write_text(f"{body}\nclass Alone: ...\nclass Shared: ...\none, shared = Alone(), Shared()\n")
    (package / "two.py").write_text("from camopt.cam.one import Shared\n")
    monkeypatch.setattr(f"{__name__}.PACKAGE", tmp_path / "camopt")
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    trees.cache_clear()
    try:
        assert small_files() == {"cam": ["camopt/cam/two.py"]}
        assert classes_of_one_place() == {"cam": ["camopt/cam/one.py: Alone"]}
        assert modules_with_one_importer() == {"cam": ["camopt/cam/one.py"]}
    finally:
        trees.cache_clear()


def main(words: list[str]) -> None:
    if words[:1] == ["--table"]:
        before, after = of_checkout(Path(words[1]).resolve()), house()
        for name in before | after:
            print(f"{name:<28}{before.get(name, 0):>8,}{after.get(name, 0):>8,}")
        return
    before = {} if "--all" in words else allowed()
    TABLE.write_text(json.dumps(lowered(before, measured()), indent=2) + "\n", encoding="utf-8")
    print(f"{TABLE.name} is renewed")


if __name__ == "__main__":
    main(sys.argv[1:])
