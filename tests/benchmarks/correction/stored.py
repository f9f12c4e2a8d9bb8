"""Initial models that a store holds, and what they were made of; read without running a stage."""

from collections.abc import Mapping, Sequence
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
where r.state in ('completed', 'partial') and s.outcome != 'failed'
order by r.started_at
"""
INITIAL: Mapping[str, str] = {
    "faces": "faces",
    "rooms": "rooms",
    "walls": "rooms",
    "segments": "segments",
}
"""What a grammar corrects: tables, and the stage each is of."""


@dataclass(frozen=True)
class Stored:
    """Where the initial model of a storey and seed lies."""

    scored: Scored
    seed: int
    store: Path
    uris: tuple[str, ...]

    def read(self) -> tuple[Rooms, Walls, Faces, list[Segments]]:
        """Return the initial model; segments scan by scan, in the storey's order."""
        return (
            rooms.from_table(self.one("rooms")),
            walls.from_table(self.one("walls")),
            faces.from_table(self.one("faces")),
            [segments.from_table(table) for table in self.each("segments")],
        )

    def one(self, table: str) -> pa.Table:
        """Return a table of the whole storey."""
        (made,) = self.each(table)
        return made

    def each(self, table: str) -> list[pa.Table]:
        """Return a table of each scan."""
        uris = [uri for uri in self.uris if uri.startswith(f"{table}/")]
        return [pq.read_table(self.store / uri, partitioning=None) for uri in uris]


def stored_models(
    scored: Sequence[Scored],
    stores: Sequence[Path],
    seeds: int,
    wanted: Mapping[str, str] = INITIAL,
) -> list[Stored]:
    """Return the initial models of storeys in some stores, the last made of each seed.

    Parameters
    ----------
    wanted : tables, and the stage each is of
    """
    found: dict[tuple[str, str, int], Stored] = {}
    by_place = {(s.building, s.storey): s for s in scored}
    for store in stores:
        uris: dict[tuple[str, str, int, str], list[tuple[str, str]]] = {}
        for row in _made(store):
            table = row["uri"].split("/", 1)[0]
            is_wanted = wanted.get(table) == row["stage"]
            if is_wanted and (row["building"], row["storey"]) in by_place:
                key = (row["building"], row["storey"], row["seed"] or 0, row["run"])
                uris.setdefault(key, []).append((row["scan"] or "", row["uri"]))
        for (building, storey, seed, _), made in uris.items():
            tables = {uri.split("/", 1)[0] for _, uri in made}
            if seed < seeds and tables == set(wanted):
                paths = tuple(uri for _, uri in sorted(set(made)))
                of = by_place[building, storey]
                found[building, storey, seed] = Stored(of, seed, store, paths)
    return [found[key] for key in sorted(found)]


@cache
def _made(store: Path) -> list[dict[str, str]]:
    return ask(store, MADE)
