"""The shape of the code, beside what it may be at most; with `--packages`, every
package by itself.

`--worst N` names the N functions of most complexity and the N statements of most syntax
nodes; `--files` the figures of every file; a name of a package or file restricts both.

A line of code holds a token that is not a comment or a docstring. A comment has a line
of its own. Tokens are names, operators, numbers and strings. The nodes of a statement
are those of its syntax tree, without the statements inside it. The complexity of a
function counts the ways through it: one, and one more for each branch, loop, handler,
condition of a comprehension, conditional expression and operand of `and` and `or`. Its
arguments are all but `self` and `cls`; those of a command are options, and are not
counted.
"""

import argparse
import ast
import io
import re
import tokenize
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import TypeGuard

import numpy as np
from pydantic import BaseModel
from scipy.sparse.csgraph import connected_components

from hydroid.commands.app import COMMANDS
from hydroid.settings.fit import FitSettings

ROOT = Path(__file__).parents[1]
CODE = ROOT / "hydroid"
OPTIONS = CODE / "commands"
"""where functions are commands, whose arguments are options"""
CODE_TOKENS = (tokenize.NAME, tokenize.OP, tokenize.NUMBER, tokenize.STRING)
DIRECTIVE = re.compile(r"#\s*(pyright|noqa|type:|fmt:)")
"""a comment to a tool, which tells a reader nothing"""
Function = ast.FunctionDef | ast.AsyncFunctionDef
COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
BRANCHES = (
    ast.If,
    ast.IfExp,
    ast.For,
    ast.AsyncFor,
    ast.While,
    ast.ExceptHandler,
    ast.Assert,
    ast.match_case,
)
LONG_LINE = 100
MOST_COMPLEX = 12
MOST_ARGUMENTS = 6


@dataclass
class Shape:
    """Counts of one file, or of several that are added."""

    files: int = 0
    lines: int = 0
    code_lines: int = 0
    docstring_lines: int = 0
    comment_lines: int = 0
    comments_beside: int = 0
    long_lines: int = 0
    tokens: int = 0
    comprehensions: int = 0
    nested_comprehensions: int = 0
    conditionals: int = 0
    nested_conditionals: int = 0
    paired_assignments: int = 0
    functions_of_many_arguments: int = 0
    nodes: list[int] = field(default_factory=list[int])
    """of each statement"""
    complexities: list[int] = field(default_factory=list[int])
    """of each function"""

    def __add__(self, other: "Shape") -> "Shape":
        return Shape(
            *(getattr(self, name) + getattr(other, name) for name in vars(self))
        )

    def per_thousand(self, count: int) -> float:
        return 1000 * count / max(self.code_lines, 1)

    def percent(self, count: int) -> float:
        return 100 * count / max(self.lines, 1)

    def figures(self) -> dict[str, tuple[float, str]]:
        """Return every figure by its name, with what it may be at most."""
        nodes = self.nodes or [0]
        complexities = self.complexities or [0]
        too_complex = sum(complexity > MOST_COMPLEX for complexity in complexities)
        return {
            "lines": (self.lines, ""),
            "tokens": (self.tokens, ""),
            "tokens a line of code": (self.tokens / max(self.code_lines, 1), "9"),
            f"lines over {LONG_LINE} characters, %": (
                self.percent(self.long_lines),
                "0.5",
            ),
            "docstrings, % of lines": (self.percent(self.docstring_lines), ""),
            "comments, % of lines": (self.percent(self.comment_lines), "2 to 3"),
            "comments beside code, % of lines": (
                self.percent(self.comments_beside),
                "",
            ),
            "nodes a statement, mean": (float(np.mean(nodes)), ""),
            "nodes a statement, 90th percentile": (
                float(np.percentile(nodes, 90)),
                "14",
            ),
            "nodes a statement, 99th percentile": (
                float(np.percentile(nodes, 99)),
                "25",
            ),
            "complexity, mean": (float(np.mean(complexities)), "3.8"),
            "complexity, largest": (max(complexities), str(MOST_COMPLEX)),
            f"functions of complexity over {MOST_COMPLEX}": (too_complex, "0"),
            f"functions of over {MOST_ARGUMENTS} arguments": (
                self.functions_of_many_arguments,
                "0",
            ),
            "comprehensions a thousand lines": (
                self.per_thousand(self.comprehensions),
                "35",
            ),
            "nested comprehensions a thousand lines": (
                self.per_thousand(self.nested_comprehensions),
                "1",
            ),
            "conditional expressions a thousand lines": (
                self.per_thousand(self.conditionals),
                "20",
            ),
            "nested conditionals a thousand lines": (
                self.per_thousand(self.nested_conditionals),
                "0",
            ),
            "a, b = x, y a thousand lines": (
                self.per_thousand(self.paired_assignments),
                "8",
            ),
        }


def shape(path: Path) -> Shape:
    text = path.read_text()
    tree = ast.parse(text)
    tokens = [*tokenize.generate_tokens(io.StringIO(text).readline)]
    documented = docstring_lines(tree)
    comments = [
        t
        for t in tokens
        if t.type == tokenize.COMMENT and not DIRECTIVE.match(t.string)
    ]
    alone = [t for t in comments if not t.line[: t.start[1]].strip()]
    code = [t for t in tokens if t.type in CODE_TOKENS]
    code_lines = {
        line for t in code for line in range(t.start[0], t.end[0] + 1)
    } - documented
    nodes = [*ast.walk(tree)]
    comprehensions = [node for node in nodes if isinstance(node, COMPREHENSIONS)]
    conditionals = [node for node in nodes if isinstance(node, ast.IfExp)]
    functions = [node for node in nodes if isinstance(node, Function)]
    overloaded = [f for f in functions if arguments(f) > MOST_ARGUMENTS]
    return Shape(
        files=1,
        lines=len(text.splitlines()),
        code_lines=len(code_lines),
        docstring_lines=len(documented),
        comment_lines=len(alone),
        comments_beside=len(comments) - len(alone),
        long_lines=sum(len(line) > LONG_LINE for line in text.splitlines()),
        tokens=len(code),
        comprehensions=len(comprehensions),
        nested_comprehensions=sum(map(is_nested, comprehensions)),
        conditionals=len(conditionals),
        nested_conditionals=sum(holds(node, ast.IfExp) for node in conditionals),
        paired_assignments=sum(is_paired(node) for node in nodes),
        functions_of_many_arguments=0 if path.parent == OPTIONS else len(overloaded),
        nodes=[statement_nodes(s) for s in statements(tree)],
        complexities=[complexity(f) for f in functions],
    )


def docstring_lines(tree: ast.Module) -> set[int]:
    """Return the lines of strings that stand alone as statements: docstrings,
    also those of attributes."""
    lines = set[int]()
    for node in ast.walk(tree):
        if is_docstring(node):
            lines |= {*range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    return lines


def is_docstring(node: ast.AST) -> TypeGuard[ast.Expr]:
    """Return whether a statement is a string alone."""
    if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
        return False
    return isinstance(node.value.value, str)


def holds(node: ast.AST, kinds: type[ast.AST] | tuple[type[ast.AST], ...]) -> bool:
    """Return whether a node of these kinds stands inside another."""
    return any(
        isinstance(inner, kinds) for inner in ast.walk(node) if inner is not node
    )


def is_nested(
    node: ast.ListComp | ast.SetComp | ast.DictComp | ast.GeneratorExp,
) -> bool:
    """Return whether a comprehension holds another, or has several `for`."""
    return len(node.generators) > 1 or holds(node, COMPREHENSIONS)


def is_paired(node: ast.AST) -> bool:
    """Return whether a statement is `a, b = x, y`."""
    if not isinstance(node, ast.Assign) or not isinstance(node.value, ast.Tuple):
        return False
    return any(isinstance(target, ast.Tuple) for target in node.targets)


def statements(tree: ast.Module) -> list[ast.stmt]:
    """Return all statements but docstrings."""
    found = [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
    return [statement for statement in found if not is_docstring(statement)]


def statement_nodes(statement: ast.stmt) -> int:
    """Return the number of nodes of a statement, without those of the statements inside
    it.

    What a node only carries along does not count: operators, and whether a name is read
    or written.
    """
    carried = (ast.expr_context, ast.operator, ast.unaryop, ast.cmpop, ast.boolop)
    count = 0
    open_nodes: list[ast.AST] = [statement]
    while open_nodes:
        node = open_nodes.pop()
        count += 1
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, (ast.stmt, *carried)):
                open_nodes.append(child)
    return count


def complexity(function: Function) -> int:
    """Return one more than the number of branches of a function,
    without those of functions inside it."""
    count = 1
    open_nodes: list[ast.AST] = [*function.body]
    while open_nodes:
        node = open_nodes.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            continue
        if isinstance(node, BRANCHES):
            count += 1
        elif isinstance(node, ast.BoolOp):
            count += len(node.values) - 1
        elif isinstance(node, ast.comprehension):
            count += 1 + len(node.ifs)
        open_nodes.extend(ast.iter_child_nodes(node))
    return count


def arguments(function: Function) -> int:
    every = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    names = [argument.arg for argument in every]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def imports(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (
                node.module,
                *(f"{node.module}.{alias.name}" for alias in node.names),
            )
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def cycles(trees: dict[Path, ast.Module]) -> int:
    """Return the number of groups of files that import each other (strongly connected
    components)."""
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in trees]
    names = [name.removesuffix(".__init__") for name in names]
    taken = [
        set(imports(tree)) - {own}
        for own, tree in zip(names, trees.values(), strict=True)
    ]
    graph = np.array([[name in some for name in names] for some in taken])
    group_of = connected_components(graph, connection="strong")[1]
    return int(np.sum(np.bincount(group_of) > 1))


def constants(tree: ast.Module) -> int:
    """Return the number of names in capitals at the top level of a file."""
    assigned = (
        getattr(node, "targets", [getattr(node, "target", None)]) for node in tree.body
    )
    nodes = chain(*(ast.walk(target) for target in chain(*assigned) if target))
    names = [node.id for node in nodes if isinstance(node, ast.Name)]
    return sum(bool(re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name)) for name in names)


def settings(kind: object, seen: set[object]) -> int:
    """Return the settings that a class declares, and the classes of its fields;
    each counts once."""
    if kind in seen:
        return 0
    if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
        return sum(settings(part, seen) for part in getattr(kind, "__args__", ()))
    seen.add(kind)
    own = sum(name in kind.model_fields for name in kind.__annotations__)
    return own + sum(
        settings(field.annotation, seen) for field in kind.model_fields.values()
    )


def lines(folder: str) -> int:
    return sum(
        len(path.read_text().splitlines()) for path in (ROOT / folder).rglob("*.py")
    )


def whole_code(paths: Sequence[Path]) -> dict[str, tuple[float, str]]:
    """Return the figures of the code that no package has by itself."""
    trees = {path: ast.parse(path.read_text()) for path in paths}
    functions = [
        node
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, Function)
    ]
    targets = re.findall(
        r"^([a-z][a-z-]*):(?!=)", (ROOT / "Makefile").read_text(), re.MULTILINE
    )
    sizes = [len(path.read_text().splitlines()) for path in paths]
    return {
        "files": (len(paths), ""),
        "median file": (float(np.median(sizes)), ""),
        "largest file": (max(sizes), ""),
        "largest function": (
            max((f.end_lineno or 0) - f.lineno + 1 for f in functions),
            "",
        ),
        "constants": (sum(map(constants, trees.values())), ""),
        "settings": (settings(FitSettings, set()), "130"),
        "commands": (len(COMMANDS), "14"),
        "make targets": (len(set(targets)), "14"),
        "import cycles": (cycles(trees), "0"),
        "lines of tests": (lines("tests"), ""),
        "lines of benchmarks": (lines("benchmarks"), ""),
    }


def show(figures: dict[str, tuple[float, str]]) -> None:
    for name, (value, most) in figures.items():
        print(f"{name:42} {value:9,.6g}    {most}")


COLUMNS = {
    "code lines": lambda s: s.code_lines,
    "tokens/line": lambda s: s.tokens / max(s.code_lines, 1),
    "long %": lambda s: s.percent(s.long_lines),
    "comments %": lambda s: s.percent(s.comment_lines),
    "nodes 90th": lambda s: float(np.percentile(s.nodes or [0], 90)),
    "if-else": lambda s: s.per_thousand(s.conditionals),
    "compr.": lambda s: s.per_thousand(s.comprehensions),
    "nested": lambda s: s.per_thousand(s.nested_comprehensions + s.nested_conditionals),
    "a,b=x,y": lambda s: s.per_thousand(s.paired_assignments),
    "mean cx": lambda s: float(np.mean(s.complexities or [0])),
    "cx>12": lambda s: sum(c > MOST_COMPLEX for c in s.complexities),
    "args>6": lambda s: s.functions_of_many_arguments,
}
"""the figures of a package in one line"""


def show_parts(parts: dict[str, Shape]) -> None:
    width = max(map(len, parts))
    print(" " * width, *(f"{name:>11}" for name in COLUMNS))
    for name, part in parts.items():
        print(
            f"{name:{width}}", *(f"{value(part):11.4g}" for value in COLUMNS.values())
        )


def show_worst(paths: Sequence[Path], number: int) -> None:
    functions: list[tuple[int, str]] = []
    large: list[tuple[int, str]] = []
    for path in paths:
        tree = ast.parse(path.read_text())
        place = path.relative_to(ROOT)
        found = [node for node in ast.walk(tree) if isinstance(node, Function)]
        functions += [(complexity(f), f"{place}:{f.lineno} {f.name}") for f in found]
        large += [(statement_nodes(s), f"{place}:{s.lineno}") for s in statements(tree)]
    for title, rows in (("complexity", functions), ("nodes a statement", large)):
        print(f"\n{title}")
        for value, place in sorted(rows, reverse=True)[:number]:
            print(f"{value:6}  {place}")


def package(path: Path) -> str:
    return path.relative_to(CODE).parts[0] if path.parent != CODE else "(top)"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("names", nargs="*", help="packages or files [default: all]")
    parser.add_argument(
        "--packages", action="store_true", help="a line for every package"
    )
    parser.add_argument("--files", action="store_true", help="a line for every file")
    parser.add_argument(
        "--worst", type=int, default=0, metavar="N", help="the N worst places"
    )
    given = parser.parse_args()
    every = sorted(CODE.rglob("*.py"))
    chosen = {(CODE / name).resolve() for name in given.names}
    paths = [p for p in every if not chosen or chosen & {p, *p.parents}]
    if not paths:
        parser.error("no such package or file")
    shapes = {path: shape(path) for path in paths}
    show(
        sum(shapes.values(), Shape()).figures() | ({} if chosen else whole_code(every))
    )
    if given.packages:
        names = sorted({package(path) for path in paths})
        parts = {
            name: sum(
                (s for path, s in shapes.items() if package(path) == name), Shape()
            )
            for name in names
        }
        show_parts(parts)
    if given.files:
        show_parts({str(path.relative_to(CODE)): one for path, one in shapes.items()})
    if given.worst:
        show_worst(paths, given.worst)


if __name__ == "__main__":
    main()
