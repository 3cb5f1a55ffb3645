"""The article's figure 12: the loop of the simple genetic algorithm, with the settings that it has."""

from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from hydroid.report import style
from hydroid.settings.search import GaSettings

LEFT, RIGHT, WIDTH, HEIGHT = 0.25, 0.74, 0.44, 0.11
"""centres of the two columns of boxes, width and height of a box, as parts of the figure"""

Spot = tuple[float, float]


def flow_chart(settings: GaSettings, title: str) -> Figure:
    """Draw the loop: on the left what becomes of each generation, on the right how the next one is made."""
    code = "16-bit Gray code" if settings.coding == "binary" else "integers"
    kind = settings.crossover.capitalize()
    best = "best" if settings.elitism == 1 else f"best {settings.elitism}"
    survivors = f"with the {best} of the old one" if settings.elitism else "nothing else"
    boxes: dict[str, tuple[float, float, str]] = {
        "first": (
            LEFT,
            0.92,
            f"First generation: {settings.population} candidates,\nuniform in the bounds, {code}",
        ),
        "simulate": (LEFT, 0.7, "Simulate each candidate;\nits error is what is minimised"),
        "done": (LEFT, 0.25, f"All {settings.generations} generations done?"),
        "best": (LEFT, 0.06, "The best candidate is the estimate"),
        "roulette": (RIGHT, 0.25, "Roulette: a parent's chance is as large\nas its distance from the worst"),
        "crossover": (
            RIGHT,
            0.4,
            f"{kind} crossover of each pair,\nprobability {settings.crossover_rate:g}",
        ),
        "mutation": (RIGHT, 0.55, f"Mutation of each parameter,\nprobability {settings.mutation_rate:g}"),
        "next": (RIGHT, 0.7, f"New generation: the children,\n{survivors}"),
    }
    drawing = style.figure(4.6, left=0.1, right=0.0, bottom=0.0)
    axes = drawing.subplots()
    axes.set_title(title)
    axes.set_axis_off()
    axes.set(xlim=(0, 1), ylim=(0, 1))
    for x, y, text in boxes.values():
        corner, color = (x - WIDTH / 2, y - HEIGHT / 2), style.SEARCH if x == LEFT else style.REFINED
        shape = "round,pad=0,rounding_size=0.015"
        axes.add_patch(FancyBboxPatch(corner, WIDTH, HEIGHT, boxstyle=shape, fc="#FFFFFF", ec=color))
        axes.text(x, y, text, ha="center", va="center", fontsize=9)
    at = {name: (x, y) for name, (x, y, _) in boxes.items()}
    loop = ("roulette", "crossover", "mutation", "next", "simulate")
    for pair in (("first", "simulate"), ("simulate", "done"), *pairwise(loop)):
        _arrow(axes, at[pair[0]], at[pair[1]])
    _arrow(axes, at["done"], at["best"], "yes")
    _arrow(axes, at["done"], at["roulette"], "no")
    return drawing


def _arrow(axes: Axes, start: Spot, end: Spot, label: str = "") -> None:
    """Draw an arrow between the edges of two boxes that stand above or beside each other."""
    if start[0] == end[0]:
        side = HEIGHT / 2 if end[1] > start[1] else -HEIGHT / 2
        tail, head, aside = (start[0], start[1] + side), (end[0], end[1] - side), (0.012, 0.0)
    else:
        side = WIDTH / 2 if end[0] > start[0] else -WIDTH / 2
        tail, head, aside = (start[0] + side, start[1]), (end[0] - side, end[1]), (-0.01, 0.02)
    axes.annotate("", head, tail, arrowprops={"arrowstyle": "-|>", "color": style.MEASURED, "lw": 1.2})
    middle = ((tail[0] + head[0]) / 2 + aside[0], (tail[1] + head[1]) / 2 + aside[1])
    axes.text(*middle, label, fontsize=9, va="center")
