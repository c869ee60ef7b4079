"""Which commands the stored answers belong to, and what a command prints and writes, as one text.

Everything that a processor, a day or a folder decides is masked: times, versions, paths and dates. Of a table or a list
that is long, every n-th row stands for the others.
"""

import contextlib
import io
import json
import re
import shlex
import shutil
from pathlib import Path

from camopt.cli.parser import main
from camopt.scene import scene_text

HERE = Path(__file__).parent
LONGEST = 24
"""Rows of a table and numbers of a list that are kept, at least; twice as many at most."""
MEASURED = re.compile(
    r"(?i)(^|_)(seconds|ms|times?|saved|cost_ratio|date|versions?|platform|processor|machine|cpu|python|created|threads|"
    r"folder|path|started|finished|minutes|speed_up|faster|processor_s|clock_s|compilation_s|peak_memory_MB|cpus)(_|$)"
)
"""Keys and columns whose content the machine, the day or the folder decides; `time_s` is the motion's own."""
MOTIONS_OWN = {"time_s"}
MASKS = (
    (r"(?m)^(.*times as fast as the full model: ).*$", r"\1<times>"),
    (r"\b\d+(\.\d+)?( ?(ms|s|us|min)| seconds?| minutes?)\b(?! *\^)(?!/)", "<time>"),
    (r"sha256:[0-9a-f]+|\b[0-9a-f]{64}\b", "<digest>"),
    (r"(?m)( \d\.\d+e\+\d\d)(?: +[\d.]+){3}( <)?$", r"\1 <times>\2"),
    (r"(?m)^(  (?:smooth|exact) .* )[0-9.]+(  ?(?:trust|none|direction))", r"\1<times>\2"),
    (r"\d{4}-\d\d-\d\d[T ]\d\d:?\d\d(:?\d\d)?Z?( UTC)?", "<date>"),
)
SLOW = {
    "speeds_rpm = [5000, 6000, 7000]": "speeds_rpm = [4000, 5000]",
    "band_rpm = [5000, 7000]": "band_rpm = [4000, 5000]",
}
"""What makes `motori-1` a scene whose cams keep to the seat: a motion that bounces on without end is another one on
every processor."""
SCENES = ("slow.toml", "measured.toml")
READ = {".json", ".jsonl", ".csv", ".txt"}
"""Endings of the files whose content is kept."""
QUICK: dict[str, tuple[str, ...]] = {}
"""Commands by the name of the case, which run one after the other in one folder."""
LONG: dict[str, tuple[str, ...]] = {}
"""The same of the verbs that take longer than ten seconds."""
for scene, rpm in zip(SCENES, (4500, 7000), strict=True):
    name, varied = scene.removesuffix(".toml"), "spring.preload_N"
    search = f"optimize {scene} --accuracy draft --speeds nominal"
    QUICK |= {
        f"{name}-bound": (f"bound {scene} --json bound.json",),
        f"{name}-modes": (
            f"modes {scene} --json lifted.json",
            f"modes {scene} --state seated --json seated.json",
        ),
        f"{name}-cam": (
            f"cam {scene} --cam polydyne --csv lift.csv --card --card-csv card.csv --lobes-deg 0,90,180,270",
            f"cam {scene} --cam multi-pol --step-crank-deg 2 --digits 6 --csv lift.csv --valve-lift valve.csv",
        ),
        f"{name}-verify": (
            f"verify {scene} --cam polydyne --speeds 4000,{rpm} --accuracy draft --json all.json",
            f"verify {scene} --cam polydyne --speeds 4000 --accuracy draft --energy --periodic --json settled.json",
        ),
        f"{name}-simulate": tuple(
            f"simulate {scene} --cam polydyne --speed {rpm} --step-deg 5 --method {method} --csv {method}.csv"
            for method in ("event", "rkg", "smooth")
        ),
        f"{name}-yield": (f"yield {scene} --cam polydyne --trains 20 --speeds 3000,{rpm} --halve --out folder",),
        f"{name}-what-if": (
            f"what-if {scene} --cam polydyne --set valve.mass_kg=*0.9 --set {varied}=*1.1 --trains 8 --json table.json",
        ),
    }
    (QUICK if name == "slow" else LONG)[f"{name}-optimize"] = (
        f"{search} --out run",
        "report run --check",
        f"compare {scene} --design run --no-literature --out comparison",
    )
    LONG |= {
        f"{name}-reduce": (f"reduce {scene} --speeds {rpm} --json models.json",),
        f"{name}-free": (f"{search} --no-compare --gradient none --free {varied}=200:260 --out run",),
        f"{name}-compare": (f"compare {scene} --out comparison",),
    }
QUICK |= {
    "measured-cam-geometry": (
        "cam measured.toml --cam polydyne --speed 7000 --contour contour.csv --dynamic-lift valve.csv",
    ),
    "sweep": ("sweep plan.toml --store rows.sqlite --workers 1 --csv rows.csv",),
    "rise": (
        "rise --rise-mm 10 --over-deg 60 --step-deg 2 --csv rise.csv --json rise.json",
        "rise --rise-mm 10 --over-deg 60 --jerk-max-mm-per-deg3 0.003 --json rise.json",
    ),
    "scenes": ("scenes", "scenes motori-1"),
}
LONG["slow-gradient"] = ("gradient slow.toml --cam polydyne --speed 4500 --json metrics.json",)


def answer(commands: tuple[str, ...], folder: Path) -> str:
    """What commands print and write in an empty folder: terminal, exit codes, and every JSON, CSV and text file."""
    for source in HERE.glob("*.toml"):
        shutil.copy(source, folder)
    text = scene_text("motori-1")
    for fast, slow in SLOW.items():
        text = text.replace(fast, slow)
    (folder / SCENES[0]).write_text(text, encoding="utf-8")
    told = []
    with contextlib.chdir(folder):
        before = {}
        for line in commands:
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                code = main([*shlex.split(line), "--quiet"])
            told.append(f"$ camopt {line}\n{masked(out.getvalue(), folder)}exit code {code}\n")
            now = {path: path.read_bytes() for path in sorted(Path().rglob("*")) if path.is_file()}
            changed = [path for path in now if now[path] != before.get(path) and path.suffix in READ]
            told += [f"== {path}\n{content(path)}" for path in changed]
            before = now
    return "\n".join(told)


def content(path: Path) -> str:
    """The content of a file, thinned and masked."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        text = json.dumps(thinned(json.loads(text)), indent=1)  # of which a list that holds no other has one line
        return re.sub(r"\[[^][{}]*\]", lambda listed: " ".join(listed[0].split()), text) + "\n"
    if path.suffix == ".jsonl":
        return "".join(json.dumps(row) + "\n" for row in thinned([json.loads(line) for line in text.splitlines()]))
    if path.suffix == ".csv":
        return table(text)
    return masked(text, path.absolute().parent)


def thinned(value, key: str = ""):
    """A value of JSON with what is measured masked, and with every n-th item of a long list."""
    if MEASURED.search(key) and key not in MOTIONS_OWN and value is not None:
        return "<masked>"
    if isinstance(value, dict):
        return {name: thinned(one, name) for name, one in value.items()}
    if isinstance(value, list):
        return [thinned(one) for one in every(value)]
    return masked(value) if isinstance(value, str) else value


def table(text: str) -> str:
    """A table of CSV with the columns that are measured masked, and with every n-th row of a long one."""
    head, *rows = text.splitlines()
    names = head.split(",")
    hidden = [i for i, name in enumerate(names) if MEASURED.search(name) and name not in MOTIONS_OWN]
    lines = [head]
    for row in every(rows):
        cells = row.split(",")
        if len(cells) == len(names):
            cells = ["<masked>" if i in hidden and cell else cell for i, cell in enumerate(cells)]
        lines.append(masked(",".join(cells)))
    return "\n".join([*lines, f"({len(rows)} rows)\n"])


def every(items: list) -> list:
    """Every n-th of many items, and the last."""
    step = max(1, len(items) // LONGEST)
    return items[::step] if (len(items) - 1) % step == 0 else [*items[::step], items[-1]]


def masked(text: str, folder: Path | None = None) -> str:
    """A text without times, dates and the folder's own path."""
    if folder is not None:
        text = text.replace(str(folder), "<folder>")
    for pattern, mask in MASKS:
        text = re.sub(pattern, mask, text)
    return text
