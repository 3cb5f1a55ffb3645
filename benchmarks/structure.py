"""The size and shape of the code, beside what it may be at most: `make bench B=structure`.

    python benchmarks/structure.py [FOLDER ...]

Each folder is a checkout; the default is this one. One column per checkout. Tokens are names, operators,
numbers and strings: comments and the packing of lines do not count. Statements are those of Python's syntax
tree, docstrings left out. A function's arguments are all but `self` and `cls`; a command's arguments are its
options, and are not counted. Constants are names in capitals at the top level of a file.
"""

import ast
import io
import os
import re
import statistics
import subprocess
import sys
import tokenize
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

MOST = {
    "files": 160,
    "lines": 17_500,
    "tokens": 130_000,
    "constants": 280,
    "settings": 130,
    "commands": 14,
    "make targets": 14,
    "functions with more than 6 arguments": 0,
    "import cycles": 0,
    "lines of tests": 12_000,
    "lines of benchmarks": 2_000,
}
TOKENS = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)


def tokens(text: str) -> int:
    """Return the number of tokens of a file."""
    return sum(kind.type in TOKENS for kind in tokenize.generate_tokens(io.StringIO(text).readline))


def statements(tree: ast.Module) -> int:
    """Return the number of statements of a file."""
    every = (node for node in ast.walk(tree) if isinstance(node, ast.stmt))
    return sum(not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant)) for s in every)


def constants(tree: ast.Module) -> int:
    """Return how many names in capitals a file defines at its top level."""
    assigned = (getattr(node, "targets", [getattr(node, "target", None)]) for node in tree.body)
    names = (name for target in chain(*assigned) for name in ast.walk(target or ast.Pass()))
    return sum(isinstance(n, ast.Name) and bool(re.fullmatch(r"_?[A-Z][A-Z0-9_]*", n.id)) for n in names)


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return how many arguments a function takes besides `self` or `cls`."""
    given = function.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    return len(named) - (bool(named) and named[0].arg in ("self", "cls"))


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
    paths = (path.relative_to(package.parent).with_suffix("").as_posix() for path in trees)
    names = [path.replace("/", ".").removesuffix(".__init__") for path in paths]
    graph = np.array([[name in imports(tree) and name != own for name in names]
                      for own, tree in zip(names, trees.values(), strict=True)])  # fmt: skip
    groups = np.bincount(connected_components(graph, connection="strong")[1])
    return int(np.count_nonzero(groups > 1))


COUNT_SETTINGS = """
from pydantic import BaseModel
from hydroid.settings import arm
from hydroid.settings.fit import FitSettings

def models(annotation):
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from models(part)

seen, waiting = set(), [FitSettings, getattr(arm, "ArmFile", None) or arm.Arm]
while waiting:
    model = waiting.pop()
    if model not in seen:
        seen.add(model)
        waiting += [inner for field in model.model_fields.values() for inner in models(field.annotation)]
print(sum(len(model.model_fields) for model in seen))
"""
"""settings of a fit and of an arm, as their classes declare them"""
COUNT_COMMANDS = """
import subprocess, sys
text = subprocess.run([sys.executable, "-m", "hydroid", "--help"], capture_output=True, text=True).stdout
groups = text[text.index("Show this message"):].splitlines()[1:]
print(sum(line[:2] == "  " and line[2:3].islower() and "  " in line.strip() for line in groups))
"""


def counted(checkout: Path, program: str) -> int:
    """Return the number that a program prints about a checkout."""
    environment = os.environ | {"PYTHONPATH": str(checkout.resolve())}
    how: dict[str, Any] = {
        "cwd": checkout,
        "env": environment,
        "capture_output": True,
        "text": True,
        "check": True,
    }
    return int(subprocess.run([sys.executable, "-c", program], **how).stdout)


def lines(folder: Path) -> int:
    """Return the lines of Python below a folder."""
    return sum(len(path.read_text().splitlines()) for path in folder.rglob("*.py"))


def measure(checkout: Path) -> dict[str, float]:
    """Return the figures of one checkout, by name."""
    package = checkout / "hydroid"
    texts = {path: path.read_text() for path in sorted(package.rglob("*.py"))}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    sizes = [len(text.splitlines()) for text in texts.values()]
    nodes = [(path, node) for path, tree in trees.items() for node in ast.walk(tree)]
    functions = [(p, f) for p, f in nodes if isinstance(f, ast.FunctionDef | ast.AsyncFunctionDef)]
    wide = [f for path, f in functions if arguments(f) > 6 and not {"cli", "commands"} & set(path.parts)]
    targets = re.findall(r"^([a-z][a-z-]*):(?!=)", (checkout / "Makefile").read_text(), re.MULTILINE)
    return {
        "files": len(trees),
        "lines": sum(sizes),
        "tokens": sum(map(tokens, texts.values())),
        "statements": sum(map(statements, trees.values())),
        "constants": sum(map(constants, trees.values())),
        "settings": counted(checkout, COUNT_SETTINGS),
        "commands": counted(checkout, COUNT_COMMANDS),
        "make targets": len(set(targets)),
        "classes": sum(isinstance(node, ast.ClassDef) for _, node in nodes),
        "functions": len(functions),
        "functions with more than 6 arguments": len(wide),
        "import cycles": cycles(package, trees),
        "median file": statistics.median(sizes),
        "largest file": max(sizes),
        "largest function": max((f.end_lineno or f.lineno) - f.lineno + 1 for _, f in functions),
        "lines of tests": lines(checkout / "tests"),
        "lines of benchmarks": lines(checkout / "benchmarks"),
    }


if __name__ == "__main__":
    checkouts = [Path(name) for name in sys.argv[1:]] or [Path(__file__).parents[1]]
    columns = [measure(checkout) for checkout in checkouts]
    for name in columns[0]:
        most = f"{MOST[name]:,}" if name in MOST else ""
        print(f"{name:36}", *(f"{column[name]:9,g}" for column in columns), f"   {most}")
