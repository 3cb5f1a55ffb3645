"""Sphinx settings of the documentation; `make docs` builds it, with warnings as
errors."""

from typing import Any

from hydroid import __version__

project = "hydroid"
author = "The hydroid developers"
version = release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
# links to folders of the repository; a test follows every link
suppress_warnings = ["myst.xref_missing"]
html_theme = "furo"
html_title = "hydroid"
html_show_copyright = False
autodoc_typehints = "description"
autodoc_member_order = "bysource"
exclude_patterns = ["*.py"]


def mark_examples(
    app: object, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Mark the indented code of docstrings as code: after a blank line, an indented one
    begins an example."""
    marked: list[str] = []
    for line in lines:
        if line.startswith("    ") and marked and not marked[-1]:
            before = next((x for x in reversed(marked) if x), "")
            if not before.startswith(" "):
                marked += ["::", ""]
        marked.append(line)
    lines[:] = marked


def setup(app: Any) -> None:
    """Let it see docstrings before napoleon does."""
    app.connect("autodoc-process-docstring", mark_examples, priority=400)
