"""The size and shape of the code, beside what it may be at most.

Tokens are names, operators, numbers and strings: comments and the packing of lines do not count. A function's
arguments are all but `self` and `cls`; a command's are its options, and are not counted. Constants are names
in capitals at the top level of a file.
"""

import ast
import re
import statistics
import tokenize
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np
from pydantic import BaseModel
from scipy.sparse.csgraph import connected_components

from hydroid.commands.app import COMMANDS
from hydroid.settings.fit import FitSettings

ROOT = Path(__file__).parents[1]


def tokens(path: Path) -> int:
    kinds = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)
    with path.open("rb") as file:
        return sum(token.type in kinds for token in tokenize.tokenize(file.readline))


def constants(tree: ast.Module) -> int:
    assigned = (getattr(node, "targets", [getattr(node, "target", None)]) for node in tree.body)
    names = (name for target in chain(*assigned) for name in ast.walk(target or ast.Pass()))
    return sum(isinstance(n, ast.Name) and bool(re.fullmatch(r"_?[A-Z][A-Z0-9_]*", n.id)) for n in names)


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    names = [a.arg for a in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def cycles(trees: dict[Path, ast.Module]) -> int:
    """Return the number of groups of files that import each other (strongly connected components)."""
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in trees]
    names = [name.removesuffix(".__init__") for name in names]
    taken = [set(imports(tree)) - {own} for own, tree in zip(names, trees.values(), strict=True)]
    graph = np.array([[name in some for name in names] for some in taken])
    return int(np.sum(np.bincount(connected_components(graph, connection="strong")[1]) > 1))


def settings(kind: object, seen: set[object]) -> int:
    """Return the settings that a class declares, and the classes of its fields; each counts once."""
    if kind in seen:
        return 0
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
        return sum(settings(part, seen) for part in getattr(kind, "__args__", ()))
    seen.add(kind)
    own = sum(name in kind.model_fields for name in kind.__annotations__)
    return own + sum(settings(field.annotation, seen) for field in kind.model_fields.values())


def lines(folder: str) -> int:
    return sum(len(path.read_text().splitlines()) for path in (ROOT / folder).rglob("*.py"))


if __name__ == "__main__":
    trees = {path: ast.parse(path.read_text()) for path in sorted((ROOT / "hydroid").rglob("*.py"))}
    sizes = [len(path.read_text().splitlines()) for path in trees]
    nodes = [(path, node) for path, tree in trees.items() for node in ast.walk(tree)]
    defined = [(p, f) for p, f in nodes if isinstance(f, ast.FunctionDef | ast.AsyncFunctionDef)]
    free = ROOT / "hydroid" / "commands"
    targets = re.findall(r"^([a-z][a-z-]*):(?!=)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    many = sum(arguments(f) > 6 for p, f in defined if p.parent != free)
    measures = {  # each with what it may be at most
        "files": (len(trees), 160),
        "lines": (sum(sizes), 17_500),
        "tokens": (sum(map(tokens, trees)), 130_000),
        "constants": (sum(map(constants, trees.values())), 280),
        "settings": (settings(FitSettings, set()), 130),
        "commands": (len(COMMANDS), 14),
        "make targets": (len(set(targets)), 14),
        "functions with more than 6 arguments": (many, 0),
        "import cycles": (cycles(trees), 0),
        "median file": (statistics.median(sizes), ""),
        "largest file": (max(sizes), ""),
        "largest function": (max((f.end_lineno or f.lineno) - f.lineno + 1 for _, f in defined), ""),
        "lines of tests": (lines("tests"), 12_000),
        "lines of benchmarks": (lines("benchmarks"), 2_000),
    }
    for name, (value, most) in measures.items():
        print(f"{name:36} {value:9,g}    {most}")
