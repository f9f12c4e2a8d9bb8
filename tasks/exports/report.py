"""The report: one page that needs nothing else, neither files nor network nor script."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from importlib.resources import files
from itertools import groupby

from tasks.exports.figures.canvas import Picture
from tasks.exports.figures.inline import inline_svg

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""Whatever the page would fetch or run, a browser refuses and says so."""
Cell = str | float | int | bool | None


@dataclass(frozen=True)
class Table:
    """Rows under named columns."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True)
class Number:
    """One result that is worth a line of its own."""

    value: str
    what: str
    note: str = ""


@dataclass(frozen=True)
class Section:
    """A figure with what must be known to read it."""

    key: str
    """anchor of the section"""
    title: str
    text: tuple[str, ...]
    """paragraphs"""
    badges: tuple[str, ...] = ()
    """where the figures come from: simulated or not, how many seeds"""
    pictures: tuple[Picture, ...] = ()
    files: tuple[Picture, ...] = ()
    """figures that are files only: the page shows them otherwise"""
    wide: bool = False
    """whether pictures of one caption stand in a row of their own"""
    tables: tuple[Table, ...] = ()
    missing: tuple[str, ...] = ()
    """results that are not there, and why"""
    queries: tuple[tuple[str, str], ...] = ()
    """(what it answers, SQL) of what is shown"""


@dataclass(frozen=True)
class Report:
    """All that is told of a store."""

    title: str
    text: tuple[str, ...]
    badges: tuple[str, ...] = ()
    numbers: tuple[Number, ...] = ()
    missing: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()


def render_report(report: Report) -> str:
    """Return a report as one HTML page; the same report gives the same page."""
    css = files("tasks.exports").joinpath("report.css").read_text(encoding="utf-8")
    links = "\n".join(f'<a href="#{escape(s.key)}">{escape(s.title)}</a>' for s in report.sections)
    body = [
        "<header>",
        f"<h1>{escape(report.title)}</h1>",
        *_paragraphs(report.text),
        _badges(report.badges),
        _numbers(report.numbers),
        *_missing(report.missing),
        f'<nav aria-label="Figures">{links}</nav>',
        "</header>",
        "<main>",
        *(_section(section) for section in report.sections),
        "</main>",
    ]
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            # an icon of its own, lest a browser asks for one
            '<link rel="icon" href="data:,">',
            f"<title>{escape(report.title)}</title>",
            f"<style>\n{css}</style>",
            "</head>",
            "<body>",
            *(part for part in body if part),
            "</body>",
            "</html>",
            "",
        ]
    )


def _section(section: Section) -> str:
    parts = [
        f'<section id="{escape(section.key)}">',
        f"<h2>{escape(section.title)}</h2>",
        _badges(section.badges),
        *_paragraphs(section.text),
        *_missing(section.missing),
        *(_in_rows(section) if section.wide else [_side_by_side(section)]),
        _queries(section.queries),
        "</section>",
    ]
    return "\n".join(part for part in parts if part)


def _side_by_side(section: Section) -> str:
    """Return figures and tables, two beside each other where the page is wide enough."""
    parts = [*map(_figure, section.pictures), *map(_table, section.tables)]
    return '<div class="pictures">' + "\n".join(parts) + "</div>" if parts else ""


def _in_rows(section: Section) -> list[str]:
    """Return figures of one caption in a row under it, then the tables."""
    rows = []
    for caption, pictures in groupby(section.pictures, key=lambda picture: picture.caption):
        figures = "\n".join(_figure(replace(picture, caption="")) for picture in pictures)
        rows.append(f'<h3>{escape(caption)}</h3>\n<div class="pictures plans">{figures}</div>')
    return [*rows, *map(_table, section.tables)]


def _figure(picture: Picture) -> str:
    kind = "" if picture.themed else ' class="white"'
    told = f"<figcaption>{escape(picture.caption)}</figcaption>" if picture.caption else ""
    return f"<figure{kind}>{inline_svg(picture)}{told}</figure>"


def _paragraphs(texts: Sequence[str]) -> list[str]:
    return [f"<p>{_coded(text)}</p>" for text in texts]


def _coded(text: str) -> str:
    """Return escaped text with what stands between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))


def _missing(texts: Sequence[str]) -> list[str]:
    return [f'<p class="missing">{_coded(text)}</p>' for text in texts]


def _badges(texts: Sequence[str]) -> str:
    spans = []
    for text in texts:
        kind = ' class="simulated"' if "simulated" in text.lower() else ""
        spans.append(f"<span{kind}>{escape(text)}</span>")
    return f'<div class="badges">{"".join(spans)}</div>' if spans else ""


def _numbers(numbers: Sequence[Number]) -> str:
    parts = [
        f"<div><b>{escape(n.value)}</b>{escape(n.what)}<small>{escape(n.note)}</small></div>"
        for n in numbers
    ]
    return f'<div class="numbers">{"".join(parts)}</div>' if parts else ""


def _table(table: Table) -> str:
    """Return a table in a box that scrolls by itself, and by keys."""
    numeric = [
        any(isinstance(row[i], int | float) for row in table.rows)
        for i in range(len(table.columns))
    ]
    kinds = [' class="number"' if number else "" for number in numeric]
    head = "".join(
        f'<th scope="col"{kind}>{escape(name)}</th>'
        for name, kind in zip(table.columns, kinds, strict=True)
    )
    rows = [
        "<tr>"
        + "".join(f"<td{k}>{_cell(cell)}</td>" for cell, k in zip(row, kinds, strict=True))
        + "</tr>"
        for row in table.rows
    ]
    label = escape(table.caption)
    return "\n".join(
        [
            f'<div class="scroll" tabindex="0" role="region" aria-label="{label}">',
            f"<table><caption>{label}</caption>",
            f"<thead><tr>{head}</tr></thead>",
            "<tbody>",
            *rows,
            "</tbody></table></div>",
        ]
    )


def _cell(value: Cell) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return escape(f"{value:,.4g}" if abs(value) < 1000 else f"{value:,.0f}")
    return escape(f"{value:,}" if isinstance(value, int) else value)


def _queries(queries: Sequence[tuple[str, str]]) -> str:
    parts = [f"<p>{escape(what)}</p>\n<pre>{escape(sql.strip())}</pre>" for what, sql in queries]
    if not parts:
        return ""
    return "<details><summary>The query behind it</summary>\n" + "\n".join(parts) + "\n</details>"
