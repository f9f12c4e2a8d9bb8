"""Map every real scan set beside the project as a user would: each reader, with or without truth.

    python tests/benchmarks/real_scans.py [--data DIR] [--out DIR]

Prints a row per set: points, seconds of each stage (without compilation: the first set is mapped
once before to warm up), peak memory, planes, walls and rooms found. With --out, plans and pictures
stay there to be looked at. Data that is not there is left out. What is found of what is there,
`results.py` says.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DATA = Path(__file__).parents[2].parent / "shared" / "data"
STAGES = (
    *("clouds", "quality", "voxels", "streams"),
    *("decoded", "planes", "segments", "occupancy", "faces", "rooms"),
)


@dataclass(frozen=True)
class ScanSet:
    """One thing to map: its files below the data folder, and flags."""

    name: str
    paths: tuple[str, ...]
    flags: tuple[str, ...] = ()


SETS = (
    ScanSet("tls_office_1", ("tls_office_1/sample2_aligned.ply",)),
    ScanSet("tls_office_1_raw", ("tls_office_1/sample2_raw.ply",)),
    ScanSet("freiburg_079", ("freiburg_079_floor/fr_079_occupied.ply",)),
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
    return {
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
