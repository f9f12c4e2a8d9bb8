"""A report of a store: what it says and what it admits to lack, and how a browser shows it."""

import html
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from shapely import LineString, box

from flows import repeat
from flows.report import data as report_data
from flows.report.areas import area_section
from flows.report.curves import curve_section
from flows.report.energy import energy_sections
from flows.report.page import ask, write_report
from flows.report.plans import plan_section
from flows.report.scores import score_section
from storage import stages
from storage.artifacts import Place, write
from storage.catalog import run_query
from storage.detections import DETECTIONS
from storage.energy import ENERGY, METHODS, QUERIES, STOREY, Energy
from storage.errors import MapSenseError, StoreError
from storage.plan import Plan, PlanOpening, PlanRoom, PlanWall
from storage.plan_geojson import write_plan
from storage.runs import Run, recorded
from storage.stages import StageRow
from storage.wall_quality import WALL_QUALITY
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.evaluation.walls import WallQualityParams, compare_walls

START = datetime(2026, 1, 1, tzinfo=UTC)
SEEDS = 3
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


def house(storey: str, off_m: float = 0.0, doors: bool = True, simulated: bool = True) -> Plan:
    """Six rooms in a row, each longer than it is by `off_m`."""
    rooms = [PlanRoom(f"r{i}", box(4 * i, 0, 4 * i + 3.8, 5 + off_m * (1 + i))) for i in range(6)]
    lines = [LineString([(4 * i - 0.1, 0), (4 * i - 0.1, 5 + off_m)]) for i in range(7)]
    walls = [PlanWall(f"w{i}", line, 0.2) for i, line in enumerate(lines)]
    door = PlanOpening("d", LineString([(3.9, 1), (3.9, 1.9)]), 0.0, 2.0, "w1")
    return Plan(
        "hut",
        storey,
        tuple(rooms),
        tuple(walls),
        doors=(door,) if doors else (),
        simulated=simulated,
    )


class Store:
    """A store in the making: each run an hour after the one before."""

    def __init__(self, root: Path) -> None:
        self.root, self.runs = root, 0

    def add(self, verb, building, storey, variant="", seed=None, made=(), rows=(), **asked):
        """Record a run, what it made, and what its stages cost."""
        self.runs += 1
        name = f"r{self.runs:03d}"
        place = Place(store=str(self.root), run=name, building=building, storey=storey)
        start = START + timedelta(hours=self.runs)
        asked = json.dumps({"store": str(self.root), **asked})
        run = Run(
            name, verb, building, storey, asked, start, variant=variant, seed=seed, parameters="p"
        )
        with recorded(str(self.root), run) as record:
            for i, (kind, value) in enumerate(made):
                ref = write(kind, value, place)
                self._stage(place, f"{name}-{i}", kind.table, outputs=(ref.uri,))
            for i, (stage, points, seconds) in enumerate(rows):
                cost = {"scan": f"s{points}", "points_in": points, "wall_s": seconds}
                self._stage(place, f"{name}-s{i}", stage, **cost)
            record.end("completed", "")

    def _stage(self, place, name, stage, **changes):
        row = StageRow(
            id=name,
            run=place.run,
            scan=None,
            stage=stage,
            key=name,
            outcome="computed",
            wall_s=1.0,
            cpu_s=1.0,
            peak_memory_mb=None,
            rows_in=0,
            rows_out=0,
            points_in=0,
            points_out=0,
            error=None,
            started_at=START,
        )
        stages.append(place, replace(row, **changes))

    def evaluate(self, storey, variant, seed, found, initial, truth, true):
        """Keep a plan as an experiment does, and score it."""
        folder = self.root / "evaluations" / "hut" / storey / variant / str(seed)
        write_plan(found, folder / "plan.geojson")
        write_plan(initial, folder / "initial.geojson")
        made = (
            (DETECTIONS, detect(found, true, EvaluationParams())),
            (WALL_QUALITY, compare_walls(found, true, WallQualityParams())),
        )
        self.add("evaluate", "hut", storey, variant, seed, made, truth=str(truth))


def energy() -> Energy:
    rows = [
        (series, "0", method, n, seed)
        for series, ns in ((QUERIES, (5, 10)), (STOREY, (6,)))
        for method in METHODS
        for n in ns
        for seed in range(SEEDS)
    ]
    joules = {"MapSense": 50.0, "GraMap": 100.0, "No Processing": 200.0}
    series, storeys, methods, n, seeds = (np.array(column) for column in zip(*rows, strict=True))
    total = np.array([joules[m] * k * (1 + s / 10) for _, _, m, k, s in rows])
    zero, none = np.zeros(len(rows), np.int64), np.zeros(len(rows))
    return Energy(series, storeys, methods, n, seeds, n, zero, n, zero, none, none, none, total)


@pytest.fixture(scope="module")
def store(tmp_path_factory) -> Path:
    """Two storeys, two variants and three seeds; no doors found, no furniture there."""
    root = tmp_path_factory.mktemp("report") / "store"
    made = Store(root)
    for storey in ("0", "1"):
        true = house(storey)
        truth = root / "truths" / f"{storey}.geojson"
        write_plan(true, truth)
        for seed in range(SEEDS):
            initial = house(storey, 0.2 + 0.05 * seed, doors=False)
            final = house(storey, 0.02 + 0.01 * seed, doors=False)
            made.evaluate(storey, "default", seed, final, initial, truth, true)
            made.evaluate(storey, "initial", seed, initial, initial, truth, true)
    sizes = [10_000 * 2**i for i in range(6)]
    rows = [("planes", n, 1e-6 * n) for n in sizes] + [("clouds", n, 1e-9 * n**2) for n in sizes]
    made.add("map", "hut", "0", rows=rows)
    made.add("energy", "hut.scans", "campaign", made=[(ENERGY, energy())])
    return root


@pytest.fixture(scope="module")
def page(store, tmp_path_factory) -> Path:
    return write_report(store, tmp_path_factory.mktemp("out"))


class Reader(HTMLParser):
    """Collects the text of a page by section, its ids and its addresses."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.sections: dict[str, str] = {}
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.tags: list[str] = []
        self._at = ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.tags.append(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.addresses += [v for k, v in found.items() if k in ("src", "href", "xlink:href")]
        if tag == "section":
            self._at = found["id"]

    def handle_data(self, data):
        self.sections[self._at] = f"{self.sections.get(self._at, '')} {data}"


def test_every_figure_is_on_the_page_and_a_file(page):
    found = Reader(page.read_text())
    keys = ["figure-15", "figure-18a", "figure-18b", "precision-recall", "figure-18c"]
    keys += ["figure-19a", "figure-19b"]
    assert [key for key in found.sections if key] == keys
    names = {file.stem for file in (page.parent / "figures").iterdir()}
    assert {"figure_18a", "figure_18b", "figure_18c", "precision_recall", "figure_19a_0"} <= names
    assert {"figure_15_hut_0", "figure_15_hut_1", "figure_19b"} <= names
    for name in names:
        assert (page.parent / "figures" / f"{name}.svg").read_bytes().startswith(b"<?xml")
        assert (page.parent / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_numbers_are_those_of_the_plans(page):
    found = Reader(page.read_text()).sections
    # rooms are 3.8 m wide and longer by (1 + i) off: by hand, of the middle one of all
    errors = [3.8 * (0.02 + 0.01 * s) * (1 + i) for s in range(SEEDS) for i in range(6)]
    assert f"{np.median(errors):.2f} m²" in found[""]
    assert f"{round(float(np.mean(errors)), 3):.4g}" in found["figure-18a"]
    assert "36 rooms, simulated data" in found[""]
    # MapSense takes half of GraMap and a quarter of No Processing with every seed
    assert re.search(r"GraMap\s+3\s+50", found["figure-19a"])
    assert re.search(r"No Processing\s+3\s+75", found["figure-19b"])
    # seconds grow as points, and as their square
    assert re.search(r"planes\s+6\s+[\d.]+\s+[\d.]+\s+[\d.]+\s+1\s", found["figure-18c"])
    assert re.search(r"clouds\s+6\s+[\d.]+\s+[\d.]+\s+[\d.]+\s+2\s", found["figure-18c"])


def test_what_is_missing_is_said(page):
    found = Reader(page.read_text()).sections
    assert "No doors yet (simulated data): no plan has one, the truth has 2" in found["figure-18b"]
    assert "No furniture (simulated data): neither the truth nor" in found["figure-18b"]
    assert "No seconds of doors: no run has computed such a stage yet" in found["figure-18c"]
    assert "for no plan has any: door" in found["precision-recall"]


def test_simulated_data_and_seeds_are_named_with_every_figure(page):
    found = Reader(page.read_text()).sections
    for key in ("figure-15", "figure-18a", "figure-18b", "precision-recall"):
        assert "simulated data" in found[key]
    for key in ("figure-18a", "figure-18b", "precision-recall"):
        assert "3 seeds" in found[key]
    for key in ("figure-19a", "figure-19b"):
        assert "simulated joules" in found[key] and "3 seeds" in found[key]


def test_the_query_behind_each_figure_answers(page, store):
    text = page.read_text()
    quoted = re.findall(r"<pre>(.*?)</pre>", text, re.DOTALL)
    assert len(quoted) == 7
    for sql in quoted:
        assert run_query(store, html.unescape(sql)).num_rows > 0


def test_the_same_store_gives_the_same_bytes(page, store, tmp_path):
    again = write_report(store, tmp_path)
    files = sorted(p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file())
    assert files == sorted(
        p.relative_to(page.parent) for p in page.parent.rglob("*") if p.is_file()
    )
    for file in files:
        assert (page.parent / file).read_bytes() == (tmp_path / file).read_bytes(), file
    assert again.name == "report.html"


def test_the_page_needs_nothing_else(page):
    found = Reader(page.read_text())
    assert len(found.ids) == len(set(found.ids))
    assert "script" not in found.tags
    for address in found.addresses:
        assert address.startswith(("#", "data:")), address
        if address.startswith("#"):
            assert address[1:] in found.ids
    assert not re.search(r"url\((?!#)", page.read_text())


def test_a_moved_store_still_finds_its_plans(store, tmp_path):
    moved = tmp_path / "moved"
    shutil.copytree(store, moved)
    hidden = store.with_name("hidden")
    store.rename(hidden)
    try:
        section = plan_section(ask(moved, None), moved)
    finally:
        hidden.rename(store)
    assert section.missing == ()
    assert [picture.name for picture in section.files] == ["figure_15_hut_0", "figure_15_hut_1"]
    # initial, final and true plan each: the initial one is drawn once, though two runs have it
    assert len(section.pictures) == 6
    assert [picture.alt.split(": ")[0] for picture in section.pictures[:3]] == [
        "Floor plans, simulated data. initial model",
        "Floor plans, simulated data. final model",
        "Floor plans, simulated data. truth",
    ]


def test_a_plan_that_is_gone_or_broken_is_named(store, tmp_path):
    copy = tmp_path / "copy"
    shutil.copytree(store, copy)
    (copy / "evaluations" / "hut" / "0" / "default" / "0" / "plan.geojson").unlink()
    (copy / "evaluations" / "hut" / "1" / "default" / "0" / "plan.geojson").write_text("{")
    shutil.rmtree(copy / "truths")
    told = "\n".join(plan_section(ask(copy, None), copy).missing)
    assert "hut / 0, final: not drawn" in told
    assert "hut / 1, final: not drawn" in told
    assert "hut / 0: its truth is not drawn" in told


def test_an_unrefined_plan_is_one_panel_and_said_to_be_the_initial_one(tmp_path):
    made = Store(tmp_path / "store")
    true = house("0")
    write_plan(true, tmp_path / "truth.geojson")
    made.evaluate("0", "default", 0, true, true, tmp_path / "truth.geojson", true)
    answers = ask(made.root, None)
    plans = plan_section(answers, made.root)
    assert plans.missing == (
        "hut / 0, final: The final plan has the initial one's rooms: no grammar was applied.",
    )
    assert [picture.name for picture in plans.pictures] == [
        "figure_15_hut_0_1",
        "figure_15_hut_0_2",
    ]
    assert "No initial model is scored apart" in area_section(answers).missing[0]


def test_real_and_simulated_results_never_share_a_figure(tmp_path):
    made = Store(tmp_path / "store")
    for storey, simulated in (("0", True), ("1", False)):
        true = house(storey, simulated=simulated)
        truth = tmp_path / f"{storey}.geojson"
        write_plan(true, truth)
        made.evaluate(storey, "default", 0, true, true, truth, true)
    answers = ask(made.root, None)
    for make, name in (
        (area_section, "figure_18a"),
        (score_section, "figure_18b"),
        (curve_section, "precision_recall"),
    ):
        section = make(answers)
        names = [picture.name for picture in section.pictures]
        assert names == [f"{name}_simulated", f"{name}_real"]
        assert set(section.badges) == {"simulated data", "real scans", "1 seed"}


def test_a_store_without_results_says_so_of_every_figure(tmp_path):
    Store(tmp_path / "store").add("map", "hut", "0")
    page = write_report(tmp_path / "store", tmp_path / "out")
    found = Reader(page.read_text()).sections
    for key in ("figure-15", "figure-18a", "figure-18b", "precision-recall"):
        assert "mapsense evaluate" in found[key]
    for key in ("figure-19a", "figure-19b"):
        assert "No energy was charged yet" in found[key]
    assert "No seconds of planes" in found["figure-18c"]
    assert not (tmp_path / "out" / "figures").exists()


def test_one_building_is_asked_for_alone_with_the_scans_of_its_campaign(store, tmp_path):
    Store(store.with_name("two")).add("map", "other", "0")
    two = store.with_name("two")
    for folder in store.iterdir():
        if folder.is_dir():
            shutil.copytree(folder, two / folder.name, dirs_exist_ok=True)
    answers = ask(two, "hut")
    assert {run["building"] for run in answers.rows["runs"]} == {"hut", "hut.scans"}
    assert answers.rows["energy"] and answers.rows["areas"] and answers.rows["times"]
    (told,) = energy_sections(ask(two, "other"))[0].missing
    assert told == "No energy was charged under this name; there is energy of hut.scans."
    with pytest.raises(MapSenseError, match="no building 'nowhere'; there are: hut, "):
        write_report(two, tmp_path, "nowhere")
    with pytest.raises(MapSenseError, match="no usable name"):
        write_report(two, tmp_path, "x' or 'a' = 'a")


def test_no_store_is_an_error_that_says_so(tmp_path):
    with pytest.raises(StoreError, match="is no store"):
        write_report(tmp_path, tmp_path / "out")


def test_what_is_written_by_others_is_escaped(tmp_path):
    made = Store(tmp_path / "store")
    true = house("0")
    asked = {"plan": "/nowhere/<script>alert(1)</script>.geojson", "truth": "<img src=x>"}
    made.add("evaluate", "hut", "0", made=((DETECTIONS, detect(true, true, EvaluationParams())),))
    made.add("evaluate", "hut", "0", **asked)
    page = write_report(made.root, tmp_path / "out")
    assert not {"script", "img"} & set(Reader(page.read_text()).tags)
    assert "&lt;script&gt;" in page.read_text()


def test_variants_are_named_as_experiments_name_them():
    names = ["fine", "default", "fine.initial", "initial"]
    ordered = sorted(names, key=report_data.variant_order)
    assert ordered == ["initial", "default", "fine.initial", "fine"]
    assert report_data.told_first(names) == "default"
    assert repeat.initial_of("fine") == "fine.initial"


class Browser:
    """Chromium by its debugging pipe: messages of JSON, each ended by a zero byte."""

    def __init__(self, home: Path) -> None:
        to_them, from_us = os.pipe()
        from_them, to_us = os.pipe()
        command = (
            f"exec {CHROMIUM} --headless=new --no-sandbox --disable-gpu --hide-scrollbars "
            f"--user-data-dir={home} --remote-debugging-pipe 3<&{to_them} 4>&{to_us}"
        )
        self._process = subprocess.Popen(
            ["bash", "-c", command],
            pass_fds=(to_them, to_us),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_them)
        os.close(to_us)
        self._out, self._in = os.fdopen(from_us, "wb", 0), os.fdopen(from_them, "rb")
        self._id, self._rest = 0, b""
        self.events: list[dict] = []
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        attached = self._call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Network", "Log", "Runtime"):
            self.call(f"{domain}.enable")

    _session: str | None = None

    def call(self, method: str, **params) -> dict:
        return self._call(method, **params)

    def _call(self, method: str, **params) -> dict:
        self._id += 1
        message = {"id": self._id, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._id:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def _read(self) -> dict:
        while b"\0" not in self._rest:
            block = os.read(self._in.fileno(), 1 << 20)
            assert block, "the browser ended"
            self._rest += block
        message, self._rest = self._rest.split(b"\0", 1)
        return json.loads(message)

    def show(self, page: Path, width: int, scheme: str) -> None:
        """Load a page at a width, in a colour scheme."""
        self.events.clear()
        screen = {"width": width, "height": 844, "deviceScaleFactor": 1, "mobile": width < 500}
        self.call("Emulation.setDeviceMetricsOverride", **screen)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.call("Emulation.setEmulatedMedia", features=features)
        self.call("Page.navigate", url=page.as_uri())
        while not any(event.get("method") == "Page.loadEventFired" for event in self.events):
            self.events.append(self._read())
        time.sleep(0.2)  # what is fetched after the page was loaded would be seen, too

    def ask(self, expression: str):
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return found["result"]["value"]

    def close(self) -> None:
        self._process.terminate()
        self._process.wait(20)
        self._out.close()
        self._in.close()


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Browser]:
    opened = Browser(tmp_path_factory.mktemp("chromium"))
    yield opened
    opened.close()


CONTRAST = """
(() => {
  const light = (c) => { const [r, g, b] = c.match(/[\\d.]+/g).map((v) => v / 255).map(
    (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const clear = (c) => c === 'rgba(0, 0, 0, 0)';
  const behind = (e) => { while (e && clear(getComputedStyle(e).backgroundColor))
    e = e.parentElement; return e ? getComputedStyle(e).backgroundColor : 'rgb(255, 255, 255)'; };
  let worst = 99;
  for (const e of document.querySelectorAll(
      'h1, h2, h3, figcaption, caption, p, td, th, small, pre, summary, span, a')) {
    const a = light(getComputedStyle(e).color), b = light(behind(e));
    worst = Math.min(worst, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05));
  }
  return worst;
})()
"""


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_a_browser_shows_the_page_whole_and_quietly(browser, page, width, scheme):
    browser.show(page, width, scheme)
    requests = [
        event["params"]["request"]["url"]
        for event in browser.events
        if event.get("method") == "Network.requestWillBeSent"
    ]
    assert [url for url in requests if not url.startswith("data:")] == [page.as_uri()]
    told = ("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown")
    assert [event for event in browser.events if event.get("method") in told] == []
    assert browser.ask("document.documentElement.scrollWidth") <= width
    wide = "[...document.querySelectorAll('figure svg')].map(e => e.getBoundingClientRect().width)"
    widths = browser.ask(wide)
    assert len(widths) >= 10 and min(widths) > 250 and max(widths) < width
    assert browser.ask(CONTRAST) >= 4.5


def test_a_report_does_not_wait_for_prefect():
    code = "import sys, flows.report.page; print('prefect' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
