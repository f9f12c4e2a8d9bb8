"""The page: what stands in it, escaped, in boxes of its own, the same each time."""

from html.parser import HTMLParser

import numpy as np

from tasks.exports.figures.energy import Spent, draw_energy_by_storey
from tasks.exports.report import POLICY, Number, Report, Section, Table, render_report

EVIL = "<script>alert('x')</script> & \"quoted\""
VOID = {"meta", "link", "img", "br"}


class Tree(HTMLParser):
    """The elements of a page, each with those around it; fails where they do not nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None], tuple[str, ...]]] = []
        self.text: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes), tuple(self.open)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attributes):
        self.found.append((tag, dict(attributes), tuple(self.open)))

    def handle_data(self, data):
        self.text.append(data)


def report(text: str = "plain") -> Report:
    spent = [Spent("ring", "MapSense", 5, np.array([1e3, 2e3]))]
    section = Section(
        key="figure",
        title=text,
        text=(text, "ask `mapsense query`"),
        badges=("simulated joules", text),
        pictures=(draw_energy_by_storey("bars", spent, "2 seeds"),),
        tables=(
            Table(text, ("name", "value", text), ((text, 1234.5, None), ("b", 0.12345, True))),
        ),
        missing=(text,),
        queries=((text, f"select '{text}'"),),
    )
    return Report(text, (text,), (text,), (Number(text, text, text),), (text,), (section,))


def test_a_page_is_one_well_formed_whole():
    tree = Tree(render_report(report()))
    tags = [tag for tag, _, _ in tree.found]
    assert tags.count("h1") == tags.count("main") == tags.count("svg") == 1
    policies = [a["content"] for t, a, _ in tree.found if a.get("http-equiv")]
    assert policies == [POLICY]
    viewport = [a["content"] for t, a, _ in tree.found if a.get("name") == "viewport"]
    assert viewport == ["width=device-width, initial-scale=1"]


def test_nothing_that_is_told_becomes_markup():
    page = render_report(report(EVIL))
    tree = Tree(page)
    assert "script" not in {tag for tag, _, _ in tree.found}
    # everywhere it is told: title and heading, texts, badges, number, table, query, ...
    assert "".join(tree.text).count(EVIL) >= 14


def test_tables_scroll_within_their_own_box_and_can_be_reached_by_keys():
    tree = Tree(render_report(report()))
    boxes = [a for _, a, _ in tree.found if a.get("class") == "scroll"]
    assert [(box["tabindex"], box["role"]) for box in boxes] == [("0", "region")]
    (around,) = [around for tag, _, around in tree.found if tag == "table"]
    assert around[-1] == "div"


def test_cells_are_written_for_people():
    text = "".join(Tree(render_report(report())).text)
    for cell in ("1,234", "0.1235", "–", "yes"):
        assert cell in text


def test_words_between_backticks_are_code():
    assert "ask <code>mapsense query</code>" in render_report(report())


def test_the_same_report_is_the_same_page():
    assert render_report(report()) == render_report(report())


def test_a_report_of_nothing_is_a_page():
    tree = Tree(render_report(Report("nothing", ())))
    assert "nothing" in "".join(tree.text)
