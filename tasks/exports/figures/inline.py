"""A figure within a page: its ids are its own, its ink follows the page."""

import re
from html import escape

from tasks.exports.figures.canvas import GRID, INK, MUTED, PAPER, Picture

THEME = {INK: "var(--ink)", MUTED: "var(--muted)", GRID: "var(--grid)", PAPER: "var(--paper)"}
"""The page's colours in place of the figure's."""


def inline_svg(picture: Picture) -> str:
    """Return a figure's SVG as an element of a page, with its description.

    Prolog, metadata and style sheet go: they are of a file, and the last would rule the page.
    """
    svg = picture.svg.decode()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    # pictures of one page must not share ids
    own = re.sub(r"\W", "_", picture.name)
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{own}-\1"', svg)
    svg = re.sub(r'href="#([^"]+)"', rf'href="#{own}-\1"', svg)
    svg = re.sub(r"url\(#([^)]+)\)", rf"url(#{own}-\1)", svg)
    if picture.themed:
        for colour, variable in THEME.items():
            svg = svg.replace(colour, variable)
    head = re.sub(r'\s(width|height)="[^"]*"', "", svg[: svg.index(">")])
    described = f' role="img" aria-label="{escape(picture.alt)}"'
    return re.sub(r"\n+", "\n", head + described + svg[svg.index(">") :]).strip()
