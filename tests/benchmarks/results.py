"""Score today's model and print the README's tables of results; with --readme, put them there.

    python tests/benchmarks/results.py [--data DIR] [--readme README.md] [--seeds N]
        [--campaign DIR] [--work DIR] [--jobs N] [storey ...]

Scored are the two storeys of the simulated campaign of the paper's size, which is simulated first
unless --campaign names the folder of one, and the real storeys with a truth under --data. Every
figure is asked of the store that `mapsense evaluate` fills, by SQL. With --work, what was computed
before comes from the cache: an interrupted run goes on where it stopped.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commands import ask, mapsense
from real_truth import UNCLEAR, true_plan

from storage.plan_geojson import write_plan

DATA = Path(__file__).parents[2].parent / "shared" / "data"
BEGIN, END = "<!-- results:begin -->", "<!-- results:end -->"
PRESET = "paper"
SIMULATED, REAL = "simulated", "real"
"""The buildings that results are kept under."""
DEFAULT = "default"
"""The variant that `mapsense evaluate` scores where none is named."""
COMMAND = "tests/benchmarks/results.py"


@dataclass(frozen=True)
class Real:
    """A real storey: its scan and truth below the data folder."""

    about: str
    scan: str
    truth: str
    raw: bool = False
    """whether the scan lies in the raw frame that the truth states the way to"""


SIMULATED_STOREYS = ("ring", "wing")
REAL_STOREYS = {
    "tls_office_1": Real(
        "furnished office floor, laser, 10 cm spacing",
        "tls_office_1/sample2_aligned.ply",
        "tls_office_1/truth.json",
    ),
    "tls_office_1_raw": Real(
        "the same, raw: turned 69°, points outside",
        "tls_office_1/sample2_raw.ply",
        "tls_office_1/truth.json",
        raw=True,
    ),
    "freiburg_079": Real(
        "Freiburg 079, rooms seen through their doors, 5 cm voxels",
        "freiburg_079_floor/fr_079_occupied.ply",
        "freiburg_079_floor/truth.json",
    ),
}

SCANS = """
with each as (
  select building, storey, variant, scan, any_value(points_kept) as points
  from scans group by all
), gate as (
  select building, storey, variant, scan, bool_and(accepted is not false) as kept
  from quality group by all
)
select building, storey, variant, count(*) as made, count(*) filter (kept) as used,
       sum(points)::bigint as points
from each join gate using (building, storey, variant, scan)
group by all
"""
ROOMS = """
select building, storey, variant, n_true / seeds as n_true, n_found / seeds as n_found,
       precision, recall, f1, precision_pm, recall_pm, f1_pm
from recall_precision where class = 'room' and metric = 'iou' and threshold = 0.5
"""
AREAS = f"""
select building, storey, variant, avg(value) as iou,
       avg(abs(found_m2 - true_m2)) as mean_m2, median(abs(found_m2 - true_m2)) as median_m2,
       quantile_cont(abs(found_m2 - true_m2), 0.95) as p95_m2,
       max(abs(found_m2 - true_m2)) as worst_m2
from detections
where class = 'room' and metric = 'iou' and threshold = 0 and not ends_with(true_id, '{UNCLEAR}')
group by building, storey, variant
"""
NEAR = """
select building, storey, variant, class, precision, recall
from recall_precision
where metric = 'distance_m'
  and (class, threshold) in (('corner', 0.2), ('wall', 0.1))
"""
WALLS = """
select building, storey, variant, completeness, correctness
from wall_quality where buffer_m = 0.1
"""
COSTS = """
with each as (
  select building, storey, scan, stage, min(wall_s) as wall_s, max(peak_memory_mb) as mb
  from stages
  where outcome = 'computed'
    and stage not in ('detections', 'wall_quality', 'plane_detections', 'point_quality')
  group by all
)
select building, storey, sum(wall_s) as seconds, max(mb) as peak_mb from each group by all
"""

NOTES = """\
Rooms are matched one to one at an IoU over 0.5. The area error is that of every true room and the
one it shares most area with; IoU and area leave out rooms whose true limits are not clear. Walls by
both ends of their centre lines, of which truth read off a scan says nothing. Stages: the least
seconds each took in any seed, one after the other. Peak: of the process, all that runs in it."""

HEAD = (
    *("storey", "scans", "points", "rooms found (true)", "precision", "recall", "F1", "mean IoU"),
    *("area error: mean, median, p95, worst", "corners at 20 cm: P, R", "walls at 10 cm: P, R"),
    *("wall faces within 10 cm: of true, of found", "stages", "peak"),
)


def main() -> int:
    """Score all storeys asked for, and print or write the tables."""
    options = _options()
    with tempfile.TemporaryDirectory() as scratch:
        work = (options.work or Path(scratch)).resolve()
        work.mkdir(parents=True, exist_ok=True)
        entries = [*_simulated(options, work), *_real(options, work)]
        if not entries:
            print("nothing to be scored: see --campaign, --data and the storeys named")
            return 1
        experiment = work / "experiment.toml"
        experiment.write_text(_toml(options.seeds, entries))
        jobs = [] if options.jobs is None else ["--jobs", str(options.jobs)]
        mapsense("evaluate", str(experiment), "--store", str(work / "store"), *jobs)
        text = _tables(work / "store", entries, options.seeds)
    print(text)
    if options.readme is not None:
        _replace(options.readme, text)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real scans")
    parser.add_argument("--campaign", type=Path, help="folder of a simulated campaign")
    parser.add_argument("--seeds", type=int, default=10, help="repeats of each storey")
    parser.add_argument("--jobs", type=int, help="stages at once; one per processor without")
    parser.add_argument("--work", type=Path, help="keep everything there, and take it from there")
    parser.add_argument("--readme", type=Path, help=f"write between {BEGIN} and {END}")
    names = [*SIMULATED_STOREYS, *REAL_STOREYS]
    parser.add_argument("storeys", nargs="*", help=f"all without; of {', '.join(names)}")
    options = parser.parse_args()
    if unknown := [name for name in options.storeys if name not in names]:
        parser.error(f"unknown storey {unknown[0]!r}: use one of {', '.join(names)}")
    if options.seeds < 1:
        parser.error(f"--seeds {options.seeds}: expected at least 1")
    if options.readme is not None:
        _split(options.readme)  # said before anything is computed
    options.storeys = options.storeys or names
    return options


def _simulated(options: argparse.Namespace, work: Path) -> list[dict[str, Any]]:
    """Return the simulated storeys to be scored; simulate the campaign if there is none."""
    wanted = [name for name in SIMULATED_STOREYS if name in options.storeys]
    if not wanted:
        return []
    folder = options.campaign or work / "campaign"
    if not (folder / "campaign.json").exists():
        if options.campaign is not None:
            raise SystemExit(f"{folder}: there is no campaign.json; leave --campaign out")
        mapsense("simulate", "--preset", PRESET, "--out", str(folder))
    return [
        {
            "building": SIMULATED,
            "storey": name,
            "scans": [str((folder / name / "scans").resolve())],
            "truth": str((folder / name / "truth.geojson").resolve()),
        }
        for name in wanted
    ]


def _real(options: argparse.Namespace, work: Path) -> list[dict[str, Any]]:
    """Return the real storeys whose data is there, their truth written as plans."""
    entries = []
    for name, real in REAL_STOREYS.items():
        scan, truth = options.data / real.scan, options.data / real.truth
        if name not in options.storeys:
            continue
        if not (scan.exists() and truth.exists()):
            print(f"{name}: no {scan} or no truth beside it: left out", file=sys.stderr)
            continue
        plan = work / "truth" / f"{name}.geojson"
        plan.parent.mkdir(exist_ok=True)
        write_plan(true_plan(truth, REAL, name, real.raw), plan)
        row = {"building": REAL, "storey": name, "scans": [str(scan.resolve())]}
        entries.append(row | {"truth": str(plan)})
    return entries


def _toml(seeds: int, entries: Sequence[Mapping[str, Any]]) -> str:
    """Return the experiment's file; JSON's texts and lists are TOML's too."""
    tables = [
        "\n".join(
            ["[[storeys]]", *(f"{key} = {json.dumps(value)}" for key, value in entry.items())]
        )
        for entry in entries
    ]
    return "\n\n".join([f"seeds = {seeds}", *tables]) + "\n"


def _tables(store: Path, entries: Sequence[Mapping[str, Any]], seeds: int) -> str:
    found: dict[tuple[str, str, str], dict[str, Any]] = {}
    for sql in (ROOMS, AREAS, SCANS, WALLS):
        for row in ask(store, sql):
            found.setdefault(_key(row), {}).update(row)
    for row in ask(store, NEAR):
        found.setdefault(_key(row), {})[row["class"]] = (row["precision"], row["recall"])
    costs = {(row["building"], row["storey"]): row for row in ask(store, COSTS)}
    blocks = []
    for building in (SIMULATED, REAL):
        names = [entry["storey"] for entry in entries if entry["building"] == building]
        keys = sorted(key for key in found if key[0] == building and key[1] in names)
        rows = [_row(key, found[key], costs.get(key[:2], {})) for key in keys]
        if rows:
            blocks.append(_titles(building, seeds) + _markdown(rows))
    return "\n\n".join([*blocks, NOTES])


def _titles(building: str, seeds: int) -> str:
    repeats = f"{seeds} seeds, means" if seeds > 1 else "one seed"
    interval = " with their 95 % confidence" if seeds > 1 else ""
    if building == SIMULATED:
        what = f"*Simulated* (`mapsense simulate --preset {PRESET}`)"
    else:
        what = "Real scans, truth read off them by hand (about ±0.1 m)"
    return f"{what}, default settings, {repeats}{interval}:\n\n"


def _row(
    key: tuple[str, str, str], found: Mapping[str, Any], costs: Mapping[str, Any]
) -> tuple[str, ...]:
    building, storey, variant = key
    name = REAL_STOREYS[storey].about if building == REAL else storey
    scans, points = found.get("used"), found.get("points")
    made = found.get("made")
    # truth that knows the faces of walls, not their centre lines, has no ends to compare
    walls = (None, None) if building == REAL else found.get("wall", (None, None))
    return (
        name if variant == DEFAULT else f"{name}, {variant}",
        _text(scans, "{:.0f}") + (f" of {made}" if made != scans else ""),
        _text(points, "{:,.0f}"),
        f"{found['n_found']:.3g} ({found['n_true']:.0f})",
        _within(found["precision"], found["precision_pm"]),
        _within(found["recall"], found["recall_pm"]),
        _within(found["f1"], found["f1_pm"]),
        _text(found.get("iou"), "{:.3f}"),
        _list(found, ("mean_m2", "median_m2", "p95_m2", "worst_m2"), "{:.2f}") + " m²",
        _both(*found.get("corner", (None, None))),
        _both(*walls),
        _list(found, ("completeness", "correctness"), "{:.2f}"),
        _text(costs.get("seconds"), "{:.0f} s"),
        _text(costs.get("peak_mb"), "{:,.0f} MB"),
    )


def _within(value: float | None, pm: float | None) -> str:
    """Return a mean with half the width of its confidence interval, where there is one."""
    return _text(value) + (f" ± {pm:.2f}" if pm is not None else "")


def _both(precision: float | None, recall: float | None) -> str:
    return "-" if precision is None is recall else f"{_text(precision)}, {_text(recall)}"


def _list(found: Mapping[str, Any], names: Sequence[str], form: str) -> str:
    return ", ".join(_text(found.get(name), form) for name in names)


def _text(value: Any, form: str = "{:.2f}") -> str:
    return "-" if value is None else form.format(value)


def _key(row: Mapping[str, Any]) -> tuple[str, str, str]:
    return row["building"], row["storey"], row["variant"]


def _markdown(rows: Sequence[Sequence[str]]) -> str:
    lines = [HEAD, ["---"] * len(HEAD), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _split(readme: Path) -> tuple[str, str]:
    """Return what stands before and after the tables."""
    text = readme.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end) or BEGIN in rest or END in after:
        raise SystemExit(f"{readme}: expected one {BEGIN} and after it one {END}")
    return before, after


def _replace(readme: Path, tables: str) -> None:
    before, after = _split(readme)
    note = f"<!-- printed by {COMMAND}: not to be edited -->"
    readme.write_text(f"{before}{BEGIN}\n{note}\n\n{tables}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
