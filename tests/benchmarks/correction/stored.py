"""Initial models that a store holds, as grammars correct them; read without running a stage."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from commands import ask

from correction.storeys import Scored
from storage import faces, rooms, segments, walls
from storage.faces import Faces
from storage.rooms import Rooms
from storage.segments import Segments
from storage.walls import Walls

MADE = """
select s.building, s.storey, r.seed, s.run, s.stage, s.scan, unnest(s.outputs) as uri
from stages s join runs r on s.run = r.id and s.building = r.building and s.storey = r.storey
where s.stage in ('faces', 'rooms', 'segments') and r.state in ('completed', 'partial')
  and s.outcome != 'failed'
order by r.started_at
"""


@dataclass(frozen=True)
class Stored:
    """Where the initial model of a storey and seed lies."""

    scored: Scored
    seed: int
    store: Path
    uris: tuple[str, ...]

    def read(self) -> tuple[Rooms, Walls, Faces, list[Segments]]:
        """Return the initial model; segments scan by scan, in the storey's order."""
        made = {uri.split("/", 1)[0]: uri for uri in self.uris}
        each = [uri for uri in self.uris if uri.startswith("segments/")]
        return (
            rooms.from_table(self._table(made["rooms"])),
            walls.from_table(self._table(made["walls"])),
            faces.from_table(self._table(made["faces"])),
            [segments.from_table(self._table(uri)) for uri in each],
        )

    def _table(self, uri: str) -> pa.Table:
        return pq.read_table(self.store / uri, partitioning=None)


def stored_models(scored: Sequence[Scored], stores: Sequence[Path], seeds: int) -> list[Stored]:
    """Return the initial models of storeys in some stores, the last made of each seed."""
    found: dict[tuple[str, str, int], Stored] = {}
    by_place = {(s.building, s.storey): s for s in scored}
    for store in stores:
        uris: dict[tuple[str, str, int, str], list[tuple[str, str]]] = {}
        for row in _made(store):
            if (row["building"], row["storey"]) in by_place:
                key = (row["building"], row["storey"], row["seed"] or 0, row["run"])
                uris.setdefault(key, []).append((row["scan"] or "", row["uri"]))
        for (building, storey, seed, _), made in uris.items():
            if seed < seeds:
                paths = tuple(uri for _, uri in sorted(set(made)))
                of = by_place[building, storey]
                found[building, storey, seed] = Stored(of, seed, store, paths)
    return [found[key] for key in sorted(found)]


@cache
def _made(store: Path) -> list[dict[str, str]]:
    return ask(store, MADE)
