"""The size and shape of the code: files, lines, functions, arguments, classes, settings, import cycles.

    python benchmarks/structure.py [FOLDER ...]

Each folder is a checkout; the default is this one. One column per checkout. Lines are physical lines. A
function's arguments are all but `self` and `cls`; the command line's own functions, whose arguments are its
options, are counted apart.
"""

import ast
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

MOST_ARGUMENTS = 6

Function = ast.FunctionDef | ast.AsyncFunctionDef


def python_files(root: Path) -> dict[Path, ast.Module]:
    """Return the parsed files below a folder, by path."""
    return {path: ast.parse(path.read_text()) for path in sorted(root.rglob("*.py"))}


def arguments(function: Function) -> int:
    """Return how many arguments a function takes besides `self` or `cls`."""
    given = function.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return len(named) - (bool(named) and named[0].arg in ("self", "cls"))


def functions(tree: ast.Module) -> Iterator[Function]:
    """Yield every function and method of a file, nested ones included."""
    return (node for node in ast.walk(tree) if isinstance(node, Function))


def imports(tree: ast.Module) -> set[str]:
    """Return the modules that a file imports, inside functions and for type checks included."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found


def cycles(package: Path, trees: dict[Path, ast.Module]) -> int:
    """Return the number of groups of files that import each other (strongly connected components)."""
    names = {_module(package, path): path for path in trees}
    graph = {name: sorted(imports(trees[path]) & names.keys() - {name}) for name, path in names.items()}
    reached = {name: _reachable(graph, name) for name in graph}
    groups = {frozenset(m for m in reached[n] if n in reached[m]) for n in graph if n in reached[n]}
    return len(groups)


COUNT_SETTINGS = """
from pydantic import BaseModel
from hydroid.settings.arm import Arm
from hydroid.settings.fit import FitSettings

def models(annotation):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from models(part)

seen, waiting = set(), [FitSettings, Arm]
while waiting:
    model = waiting.pop()
    if model not in seen:
        seen.add(model)
        waiting += [inner for field in model.model_fields.values() for inner in models(field.annotation)]
print(sum(len(model.model_fields) for model in seen))
"""


def setting_count(checkout: Path) -> str:
    """Return how many settings a fit and an arm have, as their classes declare them."""
    environment = os.environ | {"PYTHONPATH": str(checkout.resolve())}
    command = [sys.executable, "-c", COUNT_SETTINGS]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()


def measure(checkout: Path) -> dict[str, str]:
    """Return the figures of one checkout, by name."""
    package = checkout / "hydroid"
    trees = python_files(package)
    lines = [len(path.read_text().splitlines()) for path in trees]
    every = [(path, f) for path, tree in trees.items() for f in functions(tree)]
    lengths = [(f.end_lineno or f.lineno) - f.lineno + 1 for _, f in every]
    wide = ["cli" in path.parts for path, f in every if arguments(f) > MOST_ARGUMENTS]
    more = f"functions with more than {MOST_ARGUMENTS} arguments"
    elsewhere = {
        name: sum(len(p.read_text().splitlines()) for p in (checkout / name).rglob("*.py"))
        for name in ("tests", "benchmarks")
    }
    classes = sum(isinstance(node, ast.ClassDef) for tree in trees.values() for node in ast.walk(tree))
    return {
        "files": f"{len(trees)}",
        "lines": f"{sum(lines):,}",
        "median file": f"{statistics.median(lines):g}",
        "largest file": f"{max(lines)}",
        "functions": f"{len(every):,}",
        "median function": f"{statistics.median(lengths):g}",
        "largest function": f"{max(lengths)}",
        f"{more}, outside cli/": f"{wide.count(False)}",
        f"{more}, in cli/": f"{wide.count(True)}",
        "classes": f"{classes}",
        "settings": setting_count(checkout),
        "import cycles": f"{cycles(package, trees)}",
        "lines of tests": f"{elsewhere['tests']:,}",
        "lines of benchmarks": f"{elsewhere['benchmarks']:,}",
    }


def main() -> None:
    """Print one column per checkout."""
    checkouts = [Path(name) for name in sys.argv[1:]] or [Path(__file__).parents[1]]
    columns = [measure(checkout) for checkout in checkouts]
    width = max(map(len, columns[0]))
    for name in columns[0]:
        print(name.ljust(width), *(column[name].rjust(8) for column in columns))


def _module(package: Path, path: Path) -> str:
    parts = [package.name, *path.relative_to(package).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _reachable(graph: dict[str, list[str]], start: str) -> set[str]:
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = set(graph[waiting.pop()]) - found
        found |= new
        waiting += new
    return found


if __name__ == "__main__":
    main()
