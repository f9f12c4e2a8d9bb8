"""Three stages: one per scan, one per scan that calls a helper, one over all scans."""

import json
import sys
from hashlib import sha256
from pathlib import Path

from prefect import flow
from prefect.task_runners import ThreadPoolTaskRunner
from toy.making import MakeParams, make
from toy.merging import MergeParams, merge
from toy.shifting import ShiftParams, shift

from storage.artifacts import Place
from storage.sources import Source
from storage.stages import of_run
from tasks.stage.declare import stage

made, shifted, merged = stage(make, "made"), stage(shift, "shifted"), stage(merge, "merged")
MAKE, SHIFT, MERGE = MakeParams(), ShiftParams(), MergeParams()


def source(path: Path) -> Source:
    data = path.read_bytes()
    digest = sha256(data).hexdigest()
    return Source(name=path.stem, path=str(path), sha256=digest, size_bytes=len(data))


@flow(task_runner=ThreadPoolTaskRunner(max_workers=2))
def toy(
    store: str,
    run: str,
    paths: list[str],
    making: MakeParams = MAKE,
    shifting: ShiftParams = SHIFT,
    merging: MergeParams = MERGE,
) -> dict:
    place = Place(store=store, run=run, building="b", storey="0")
    sources = [source(Path(path)) for path in paths]
    a = {s.name: made.submit(place.of_scan(s.name), s, making) for s in sources}
    b = {n: shifted.submit(place.of_scan(n), a[n], shifting) for n in a}
    for future in b.values():
        future.wait()
    good = [f.result() for f in b.values() if f.state.is_completed()]
    merged(place, good, merging)
    return outcomes(place)


def outcomes(place: Place) -> dict[str, list[str]]:
    """Return the stages of a run by how they ended, as stage:scan."""
    found: dict[str, list[str]] = {"computed": [], "cached": [], "failed": []}
    for row in of_run(place):
        found[row.outcome].append(f"{row.stage}:{row.scan}" if row.scan else row.stage)
    return {outcome: sorted(names) for outcome, names in found.items()}


if __name__ == "__main__":
    print(json.dumps(toy(sys.argv[1], sys.argv[2], sys.argv[3:])))
