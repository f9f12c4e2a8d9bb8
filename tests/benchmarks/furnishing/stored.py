"""What furniture is found in, as stores hold it of mapped storeys; read without running a stage."""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from commands import ask
from correction.stored import Stored

from flows.training_storeys import STORE, scanned
from storage import points, rooms
from storage.campaign import read_campaign
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.points import PointCloud
from storage.rooms import Rooms
from tasks.simulation.training import furnished_storeys

MADE = """
select s.run, s.stage, s.scan, s.key, s.outcome, s.cpu_s, s.outputs
from stages s join runs r on s.run = r.id and s.building = r.building and s.storey = r.storey
where s.stage in ('decoded', 'planes', 'rooms') and s.outcome != 'failed'
  and r.state in ('completed', 'partial')
order by s.started_at
"""


@dataclass(frozen=True)
class Surroundings:
    """Where a storey's clouds and rooms lie, and what its planes have cost."""

    name: str
    seed: int
    store: Path
    truth: Path
    points: tuple[str, ...]
    rooms: str
    planes_cpu_s: float
    """of all scans, each as when it was last computed"""

    def read(self) -> tuple[Rooms, list[PointCloud], Plan]:
        """Return the rooms, the clouds scan by scan, and what is true."""
        clouds = [points.from_table(self._table(uri)) for uri in self.points]
        return rooms.from_table(self._table(self.rooms)), clouds, read_plan(self.truth)

    def _table(self, uri: str) -> pa.Table:
        return pq.read_table(self.store / uri, partitioning=None)


def surroundings(models: Sequence[Stored], campaigns: Path) -> list[Surroundings]:
    """Return where the clouds and rooms of some initial models lie."""
    runs = {store: _runs(store) for store in {model.store for model in models}}
    found = []
    for model in models:
        (room,) = (uri for uri in model.uris if uri.startswith("rooms/"))
        scored = model.scored
        of = runs[model.store][room]
        found.append(
            Surroundings(
                scored.name, model.seed, model.store, scored.truth(campaigns), *_parts(of, room)
            )
        )
    return found


def training(work: Path) -> list[Surroundings]:
    """Return where those of the storeys lie that `mapsense train` learns from.

    Raises
    ------
    SystemExit
        If they are not mapped.
    """
    store, found = work / STORE, []
    known = _runs(store) if store.is_dir() else {}
    for storey in furnished_storeys():
        place = f"building={storey.building}/storey={storey.storey}/"
        mine = [uri for uri in known if place in uri]
        if not mine:
            raise SystemExit(f"{work}: {storey.building} is not mapped; run `mapsense train` first")
        campaign = scanned(storey, work, lambda _: None)
        (of,) = read_campaign(campaign).storeys
        uri = mine[-1]
        parts = _parts(known[uri], uri)
        found.append(Surroundings(storey.building, 0, store, campaign / of.truth, *parts))
    return found


Row = dict[str, object]


def _runs(store: Path) -> dict[str, list[Row]]:
    """Return the stages of the last run that made each storey's rooms, by what it made."""
    runs: dict[str, list[Row]] = defaultdict(list)
    costs: dict[str, float] = {}
    for row in ask(store, MADE):
        runs[row["run"]].append(row)
        if row["outcome"] == "computed":
            costs[row["key"]] = row["cpu_s"]
    made = {}
    for rows in runs.values():
        for row in rows:
            row["cpu_s"] = costs.get(row["key"], 0.0)
            if row["stage"] == "rooms":
                uri = _of(row["outputs"], "rooms")
                made.pop(uri, None)
                made[uri] = rows
    return made


def _parts(rows: Iterable[Row], room: str) -> tuple[tuple[str, ...], str, float]:
    clouds = {r["scan"]: _of(r["outputs"], "points") for r in rows if r["stage"] == "decoded"}
    planes = {r["scan"]: r["cpu_s"] for r in rows if r["stage"] == "planes"}
    return tuple(clouds[scan] for scan in sorted(clouds)), room, sum(planes.values())


def _of(uris: Iterable[str], table: str) -> str:
    return next(uri for uri in uris if uri.startswith(f"{table}/"))
