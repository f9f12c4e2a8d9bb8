"""Map every real scan set beside the project as a user would, and score it where there is truth.

    python tests/benchmarks/real_scans.py [--data DIR] [--out DIR]

Prints a row per set: points, seconds of each stage (without compilation: the first set is mapped
once before to warm up), peak memory, planes, walls and rooms found, and against truth read off the
scans by hand: precision, recall and F1 of rooms matched one to one at IoU 0.5, and the share of
the wall faces' length within 15 cm of a found outline. Data that is not there is left out.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from tasks.evaluation.rooms import ious, match

DATA = Path(__file__).parents[2].parent / "shared" / "data"
STAGES = (
    *("clouds", "quality", "voxels", "streams"),
    *("decoded", "planes", "segments", "occupancy", "faces", "rooms"),
)


@dataclass(frozen=True)
class ScanSet:
    """One thing to map: its files below the data folder, flags, and where its truth lies."""

    name: str
    paths: tuple[str, ...]
    flags: tuple[str, ...] = ()
    truth: str | None = None


SETS = (
    ScanSet("tls_office_1", ("tls_office_1/sample2_aligned.ply",), (), "tls_office_1/truth.json"),
    ScanSet("tls_office_1_raw", ("tls_office_1/sample2_raw.ply",), (), "tls_office_1/truth.json"),
    ScanSet(
        "freiburg_079",
        ("freiburg_079_floor/fr_079_occupied.ply",),
        (),
        "freiburg_079_floor/truth.json",
    ),
    ScanSet("pcl_room_1", ("pcl_room_scans/room_scan1.pcd",)),
    ScanSet("pcl_room_2", ("pcl_room_scans/room_scan2.pcd",)),
    ScanSet("ipad_430_db", ("ipad_lidar_ceilings/pix4d_database_430_db.ply",)),
    ScanSet("ipad_560_db", ("ipad_lidar_ceilings/pix4d_database_560_db.ply",)),
    ScanSet("ipad_560_user", ("ipad_lidar_ceilings/pix4d_user_560_user.ply",)),
    ScanSet("kitchen_cloud", ("kinect_kitchen_7scenes/registered_gravity_aligned_2cm.ply",)),
    ScanSet(
        "kitchen_frames",
        ("kinect_kitchen_7scenes",),
        ("--set", "scans.trajectory=trajectory_gravity_tum.txt"),
    ),
    ScanSet("hallway_3dtk", ("hallway_3dtk",)),
)


def main() -> int:
    """Map all sets and print the table; return 1 if one of them did not end well."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--out", type=Path, default=None, help="keep plans and pictures there")
    parser.add_argument("sets", nargs="*", help="names of sets; all without")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = options.out or Path(scratch) / "out"
        rows = [
            row
            for scan_set in SETS
            if not options.sets or scan_set.name in options.sets
            if (row := _row(scan_set, options.data, out, Path(scratch))) is not None
        ]
    _show(rows)
    return int(any(row["state"] != "completed" for row in rows))


def _row(scan_set: ScanSet, data: Path, out: Path, scratch: Path) -> dict[str, Any] | None:
    if not all((data / path).exists() for path in scan_set.paths):
        return None
    store = scratch / "store"
    if not store.exists():
        _map(scan_set, data, out, scratch / "warm")
    summary = _map(scan_set, data, out, store)
    stages = summary.get("stages", {})
    rows = summary.get("found", {}).get("rows", {})
    row: dict[str, Any] = {
        "set": scan_set.name,
        "state": summary["state"],
        "points": summary.get("used", {}).get("points", 0),
        **{f"{name}_s": round(stages.get(name, {}).get("wall_s", 0.0), 2) for name in STAGES},
        "peak_mb": _peak(scan_set.name, store),
        "planes": rows.get("planes", 0),
        "walls": rows.get("walls", 0),
        "rooms": rows.get("rooms", 0),
        "floor_m": summary.get("found", {}).get("floor_m"),
        "ceiling_m": summary.get("found", {}).get("ceiling_m"),
    }
    if scan_set.truth is not None and summary["state"] == "completed":
        row |= score(out / scan_set.name / "plan.geojson", data / scan_set.truth, scan_set.name)
    return row


def _map(scan_set: ScanSet, data: Path, out: Path, store: Path) -> dict[str, Any]:
    command = [
        str(Path(sys.executable).with_name("mapsense")),
        "map",
        *(str(data / path) for path in scan_set.paths),
        *("--building", "real", "--storey", scan_set.name),
        *("--store", str(store), "--out", str(out / scan_set.name)),
        *scan_set.flags,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{scan_set.name}: exit code {done.returncode}: {done.stderr.strip()}", flush=True)
        return {"state": "failed"}
    return dict(json.loads((out / scan_set.name / "summary.json").read_text()))


def _peak(storey: str, store: Path) -> float:
    sql = f"select max(peak_memory_mb) as mb from stages where storey = '{storey}'"
    command = [str(Path(sys.executable).with_name("mapsense")), "query", sql]
    command += ["--store", str(store), "--format", "json"]
    answer = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    return round(answer[0]["mb"] or 0.0)


def score(plan: Path, truth_file: Path, name: str) -> dict[str, Any]:
    """Score a plan's rooms and outlines against truth read off the scan.

    The raw scan's plan is brought into the truth's frame by the stated matrix, not by fitting.
    """
    truth = json.loads(truth_file.read_text())
    features = json.loads(plan.read_text())["features"]
    found = [shapely.geometry.shape(f["geometry"]) for f in features
             if f["properties"]["kind"] == "room"]  # fmt: skip
    if name.endswith("_raw"):
        matrix = np.array(truth["raw_to_aligned"])
        found = [shapely.transform(p, lambda xy: xy @ matrix[:2, :2].T + matrix[:2, 3])
                 for p in found]  # fmt: skip
    rooms = [shapely.Polygon(r["polygon"]) for r in truth["rooms"]]
    overlap = ious(found, rooms)
    best = np.append(overlap, np.zeros((1, len(rooms))), axis=0)[match(overlap), range(len(rooms))]
    hits = int((best > 0.5).sum())
    pieces = truth.get("room_faces") or truth["walls"]
    outlines = shapely.union_all([p.exterior for p in found])
    near = length = 0.0
    for piece in pieces:
        line = shapely.LineString([piece["p0"], piece["p1"]])
        places = np.linspace(0, line.length, max(3, int(line.length / 0.05)))
        away = shapely.distance(shapely.line_interpolate_point(line, places), outlines)
        near += line.length * float((away < 0.15).mean())
        length += line.length
    return {
        "precision": round(hits / max(len(found), 1), 2),
        "recall": round(hits / len(rooms), 2),
        "f1": round(2 * hits / (len(found) + len(rooms)), 2),
        "faces_15cm": round(near / length, 2),
    }


def _show(rows: list[dict[str, Any]]) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [names] + [[_text(row.get(name)) for name in names] for row in rows]
    widths = [max(len(line[c]) for line in cells) for c in range(len(names))]
    for line in cells:
        print("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)))


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.2f}" if isinstance(value, float) and abs(value) < 100 else str(value)


if __name__ == "__main__":
    sys.exit(main())
