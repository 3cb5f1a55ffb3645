"""One page that says what was fitted, what came out, how well, and what to beware of.

The page holds its figures inside and loads nothing from elsewhere: it can be mailed and printed.
"""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, StrictUndefined

from hydroid.report.table import Table, shown


@dataclass(frozen=True)
class Picture:
    """A figure of the page: SVG, and in words what it shows."""

    svg: bytes
    caption: str

    @property
    def uri(self) -> str:
        """The image itself as an address; inside an image, ids of two figures cannot clash."""
        return f"data:image/svg+xml;base64,{base64.b64encode(self.svg).decode()}"


@dataclass(frozen=True)
class Section:
    """A heading, a sentence, and below it facts, tables, figures."""

    title: str
    text: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    points: tuple[str, ...] = ()


def report_html(title: str, lead: str, sections: Sequence[Section], names: Mapping[str, str]) -> str:
    """Return the page.

    Args:
        title: of the page.
        lead: the answer in a sentence.
        sections: in order.
        names: what is printed in the foot, label by label: versions.
    """
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["shown"] = shown
    source = files("hydroid.report").joinpath("template.html.j2").read_text(encoding="utf-8")
    return environment.from_string(source).render(title=title, lead=lead, sections=sections, names=names)
