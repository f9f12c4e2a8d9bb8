"""Measure speed, memory and accuracy against what people would use instead.

    python tests/benchmarks/run.py [section ...] [--json FILE] [--quick]

Nothing fails for being slow: targets are reported as met or missed. Figures are comparable within
one run only: quote the ratios.
"""

import argparse
import json
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from catalog import catalog
from codec import codec
from planes import planes
from rays import rays
from readers import memory, readers
from report import Report, machine
from storey import storey
from viterbi import viterbi
from voxels import voxels

SECTIONS: dict[str, Callable[[bool], Report]] = {
    "planes": planes,
    "storey": storey,
    "readers": readers,
    "voxels": voxels,
    "codec": codec,
    "viterbi": viterbi,
    "rays": rays,
    "memory": memory,
    "catalog": catalog,
}
"""A section takes `quick` and returns its report. A new one is added here."""
ON_REQUEST = ("memory", "catalog")
"""Sections that run only when named."""


def main(arguments: list[str] | None = None) -> int:
    """Run the sections asked for; return 1 if one of them did not run through."""
    options = _options(arguments)
    about = machine()
    print("  ".join(f"{name} {value}" for name, value in about.items()), end="\n\n", flush=True)
    sections: dict[str, Any] = {}
    for name in options.sections or [name for name in SECTIONS if name not in ON_REQUEST]:
        start = time.perf_counter()
        try:
            report = SECTIONS[name](options.quick)
        except Exception:
            traceback.print_exc()
            sections[name] = {"error": traceback.format_exc()}
            continue
        took = time.perf_counter() - start
        print(f"{report.text()}\n  section took {took:.0f} s\n", flush=True)
        sections[name] = report.as_json() | {"took_s": took}
    if options.json is not None:
        result = {"machine": about, "quick": options.quick, "sections": sections}
        options.json.write_text(json.dumps(result, indent=1) + "\n")
    return int(any("error" in section for section in sections.values()))


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sections", nargs="*", metavar="section", help=", ".join(SECTIONS))
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all raw figures there")
    parser.add_argument("--quick", action="store_true", help="fewer runs, no rivals at 2 million")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.sections if name not in SECTIONS]:
        parser.error(f"unknown section {unknown[0]!r}: use one of {', '.join(SECTIONS)}")
    return options


if __name__ == "__main__":
    sys.exit(main())
