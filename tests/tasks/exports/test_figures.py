"""The figures: the numbers in them, that they are drawn alike each time, that none is cut."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from PIL import Image
from scipy import stats
from shapely import box

from storage.plan import Plan, PlanRoom
from tasks.exports.figures import canvas
from tasks.exports.figures.areas import AreaErrors, draw_area_errors
from tasks.exports.figures.canvas import Picture, colours
from tasks.exports.figures.curves import Operating, draw_precision_recall
from tasks.exports.figures.energy import Spent, draw_energy_by_queries, draw_energy_by_storey
from tasks.exports.figures.inline import inline_svg
from tasks.exports.figures.intervals import mean_of
from tasks.exports.figures.plans import Panel, draw_plans
from tasks.exports.figures.scores import Scores, draw_scores
from tasks.exports.figures.times import StageTimes, draw_times

NONE = np.array([])
RNG = np.random.default_rng(1)


def plan(wide: float, simulated: bool = False) -> Plan:
    rooms = (PlanRoom("a", box(0, 0, wide, 3)), PlanRoom("b", box(wide + 0.2, 0, wide + 4, 3)))
    return Plan("hut", "0", rooms, simulated=simulated)


AREAS = [
    AreaErrors("ring", "initial", RNG.exponential(1.0, 30), 2, 3),
    AreaErrors("ring", "final", RNG.exponential(0.3, 32), 0, 3),
    AreaErrors("wing", "initial", NONE, 4, 1),
    AreaErrors("wing", "final", np.array([0.5]), 3, 1),
]
SCORES = [
    Scores("walls", "both ends within 20 cm", "initial", np.array([0.5, 0.7]), np.array([0.4, 1])),
    Scores("walls", "both ends within 20 cm", "final", np.array([1.0]), np.array([1.0])),
    Scores("doors", "IoU > 0.5", "final", np.array([0.0]), np.array([np.nan])),
]
POINTS = np.array([1e4, 1e5, 1e6])
TIMES = [
    StageTimes("planes", POINTS, 2e-6 * POINTS, 3, 1.0, float(np.log(2e-6))),
    StageTimes("doors", POINTS[:1], np.array([0.5]), 1, np.nan, np.nan),
    StageTimes("furniture", POINTS, POINTS**0.5, 3, 0.5, 0.0),
]
CURVES = [
    Operating("wall\ndistance", "initial", 0.1, np.array([0.2, 0.3]), np.array([0.1, 0.2])),
    Operating("wall\ndistance", "initial", 0.2, np.array([0.6, 0.7]), np.array([0.5, 0.6])),
    Operating("wall\ndistance", "final", 0.1, np.array([1.0]), np.array([1.0])),
    Operating("door\nIoU", "final", 0.5, np.array([0.5]), np.array([np.nan])),
]
SPENT = [
    Spent("ring", method, n, joules * n * np.array([0.9, 1.0, 1.1]))
    for method, joules in (("GraMap", 200.0), ("MapSense", 150.0), ("No Processing", 300.0))
    for n in (5, 10, 40)
]
FIGURES = {
    "areas": lambda: [draw_area_errors("areas", AREAS, "simulated data, 3 seeds")],
    "nothing found": lambda: [draw_area_errors("none", AREAS[2:3], "real scans")],
    "scores": lambda: [draw_scores("scores", SCORES, "simulated data")],
    "times": lambda: [draw_times("times", TIMES)],
    "curves": lambda: [draw_precision_recall("curves", CURVES, "2 seeds")],
    "queries": lambda: [draw_energy_by_queries("queries", "ring", SPENT, "3 seeds")],
    "one seed": lambda: [
        draw_energy_by_queries("q", "r", [replace(s, totals_j=s.totals_j[:1]) for s in SPENT], "1")
    ],
    "storeys": lambda: [draw_energy_by_storey("storeys", SPENT[::3], "3 seeds")],
    "plans": lambda: draw_plans(
        "plans", [Panel("final", plan(5)), Panel("truth", plan(6))], plan(6)
    ),
    "empty plan": lambda: draw_plans("empty", [Panel("final", Plan("hut", "0"))], None),
}


@pytest.mark.parametrize("figure", FIGURES)
def test_every_figure_is_drawn_alike_each_time(figure):
    first, second = FIGURES[figure](), FIGURES[figure]()
    assert first == second
    for picture in first:
        assert picture.png.startswith(b"\x89PNG")
        assert ET.fromstring(picture.svg).tag.endswith("svg")
        assert not re.search(rb"dc:date|matplotlib v", picture.svg)
        assert "nan" not in picture.alt.lower()


@pytest.mark.parametrize("figure", FIGURES)
def test_no_figure_is_cut_at_its_edge(figure):
    for picture in FIGURES[figure]():
        pixels = np.asarray(Image.open(BytesIO(picture.png)).convert("L"))
        edges = (pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1])
        assert all((edge == 255).all() for edge in edges)


@pytest.mark.parametrize("n", [2, 3, 10, 40])
def test_an_interval_is_that_of_scipy(n):
    values = np.random.default_rng(n).normal(5.0, 2.0, n)
    low, high = stats.t.interval(0.95, n - 1, values.mean(), stats.sem(values))
    found = mean_of(np.append(values, np.nan))
    assert (found.value, found.low, found.high) == pytest.approx((values.mean(), low, high))


def test_of_one_value_there_is_no_interval_and_of_none_no_mean():
    one, none = mean_of(np.array([3.0])), mean_of(np.array([np.nan]))
    assert one.value == 3.0 and np.isnan([one.low, one.high]).all()
    assert np.isnan([none.value, none.low, none.high]).all()


def test_descriptions_say_what_is_to_be_seen():
    (areas,) = FIGURES["areas"]()
    assert f"median {np.median(AREAS[1].errors_m2):.2f} m²" in areas.alt
    assert "wing, initial: no room found" in areas.alt
    (scores,) = FIGURES["scores"]()
    assert "walls, initial: recall 60.0 %, precision 70.0 %" in scores.alt
    assert "doors, final: recall 0.0 %, precision not defined" in scores.alt
    (times,) = FIGURES["times"]()
    assert "planes: median 0.2 s, slope 1.00" in times.alt
    (curves,) = FIGURES["curves"]()
    assert "0.2: recall 65 %, precision 55 %" in curves.alt
    assert "door, IoU, final: nothing found" in curves.alt
    (queries,) = FIGURES["queries"]()
    assert "At 40 queries: MapSense 6.0 kJ, GraMap 8.0 kJ, No Processing 12.0 kJ" in queries.alt


def test_simulated_plans_say_so():
    pictures = draw_plans("p", [Panel("final", plan(5)), Panel("truth", plan(6, True))], plan(6))
    assert "simulated data" in pictures[0].alt
    real = draw_plans("p", [Panel("final", plan(5))], None)
    assert "simulated" not in real[0].alt


def test_panels_of_one_storey_have_one_scale():
    whole, small, large = draw_plans("p", [Panel("s", plan(3)), Panel("l", plan(9))], None)
    assert whole.name == "p" and (small.name, large.name) == ("p_1", "p_2")
    sizes = [re.search(rb'viewBox="0 0 (\S+) (\S+)"', each.svg).groups() for each in (small, large)]
    assert sizes[0] == sizes[1]


def test_colours_are_told_apart_without_red_and_green():
    # Machado et al. (2009), deuteranopia and protanopia at full strength, on linear light
    confusions = (
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.01182, 0.04294, 0.968881],
        ],
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ],
    )
    names = canvas.SERIES
    rgb = np.array([[int(name[i : i + 2], 16) for i in (1, 3, 5)] for name in names]) / 255
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    for matrix in confusions:
        seen = np.clip(linear @ np.array(matrix).T, 0, 1) ** (1 / 2.4)
        apart = np.linalg.norm(seen[:, None] - seen[None], axis=2)
        assert apart[~np.eye(len(names), dtype=bool)].min() > 0.2


def test_colours_go_by_first_appearance():
    assert list(colours(["b", "a", "b"])) == ["b", "a"]
    assert len(set(colours("abcdef").values())) == 6


def test_an_inline_figure_keeps_its_ids_to_itself_and_takes_the_page_s_ink():
    (picture,) = FIGURES["scores"]()
    svg = inline_svg(picture)
    root = ET.fromstring(svg)
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert ids and all(name.startswith("scores-") for name in ids)
    links = re.findall(r'href="#([^"]+)"|url\(#([^)]+)\)', svg)
    assert links and all((a or b) in ids for a, b in links)
    assert canvas.INK not in svg and "var(--ink)" in svg
    assert "<style" not in svg and "<metadata" not in svg
    assert root.get("role") == "img" and root.get("aria-label") == picture.alt


def test_a_description_is_escaped():
    quoted = Picture("p", 'a "b" <c> & d', FIGURES["queries"]()[0].svg, b"")
    assert ET.fromstring(inline_svg(quoted)).get("aria-label") == 'a "b" <c> & d'
