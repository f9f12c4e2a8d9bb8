"""The runs of storeys: what was asked, when, and how it ended; enough to run it again."""

import json
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from storage.artifacts import Place, check_name, column, replace_table, schema
from storage.errors import StoreError
from storage.leases import is_leased, leased, wait_for
from storage.locks import FOLDER, held, is_held
from storage.remote import refresh, share
from storage.stages import reason

RUNNING, COMPLETED, PARTIAL, FAILED = "running", "completed", "partial", "failed"
ENERGY = "energy"
"""The verb of runs that charge a campaign."""
EVALUATE = "evaluate"
"""The verb of runs that measure what others made: they are no news of the storey's mapping."""
DEFAULT = "default"
"""The variant of a comparison that names none."""
INITIAL_MODEL = "initial"
"""The variant that stands for the initial model, where the default's final one differs from it; of
another variant its name is added before a dot."""
MAPPED = (COMPLETED, PARTIAL)
"""States that left a plan; of a partial run some scans were skipped."""


@dataclass(frozen=True)
class Run:
    """One run of one storey."""

    id: str
    verb: str
    building: str
    storey: str
    asked: str
    started_at: datetime
    ended_at: datetime | None = None
    state: str = RUNNING
    message: str = ""
    variant: str = ""
    """name of the method compared; '' of plain mapping"""
    seed: int | None = None
    """seed all random stages were given; None: each its own"""
    parameters: str = ""
    """what its parameters are known by, seeds aside: `parameter_set`"""

    def request(self) -> dict[str, Any]:
        """Return what was asked."""
        return json.loads(self.asked)


SCHEMA = schema(
    "runs",
    [
        column("id", pa.string(), "the run"),
        column("verb", pa.string(), "what asked for it: map, demo or a flow"),
        column("asked", pa.string(), "JSON: sources, parameters, where the results go"),
        column("started_at", pa.timestamp("us", tz="UTC"), "start"),
        column("ended_at", pa.timestamp("us", tz="UTC"), "end; null if it has none", nullable=True),
        column("state", pa.string(), "running, completed, partial (scans skipped) or failed"),
        column("message", pa.string(), "what a person should know of the end; '' if nothing"),
        column("variant", pa.string(), "method compared; '' of plain mapping"),
        column("seed", pa.int64(), "seed all random stages were given; null: own", nullable=True),
        column("parameters", pa.string(), "parameter set, seeds aside"),
    ],
)


def new_id(now: datetime | None = None) -> str:
    """Return an id that sorts by time."""
    return f"{now or datetime.now(UTC):%Y%m%dT%H%M%S.%f}-{uuid.uuid4().hex[:6]}"


def parameter_set(params: Mapping[str, Any]) -> str:
    """Return what the parameters of a run are known by: repeats differ in their seeds alone.

    Parameters
    ----------
    params : mapping
        Parameters by stage, as JSON; every field named `seed`, at any depth, is left out.

    Returns
    -------
    str
        12 hexadecimal digits.
    """
    text = json.dumps(_without_seeds(params), sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:12]


def _without_seeds(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _without_seeds(part) for name, part in value.items() if name != "seed"}
    return value


@dataclass
class Recorder:
    """Holds how a run that goes on has ended, once that is known."""

    run: Run

    def end(self, state: str, message: str) -> None:
        """Say how the run ended; written when the run is left."""
        self.run = replace(self.run, state=state, message=message)


@contextmanager
def recorded(store: str, run: Run) -> Iterator[Recorder]:
    """Record a run at its start and at its end; one that raises is recorded as failed.

    While it goes on, the run holds a lock that its death drops: so others can tell a run that
    goes on from one that was killed. And it shares the lock of its storey: so nothing is pruned
    there meanwhile. Its lease tells both to other machines.
    """
    lock = _lock(store, run.id)
    with (
        held(storey_lock(store, run.building, run.storey), shared=True),
        held(lock),
        leased(_lease(run)),
    ):
        wait_for(pruning_lease(run.building, run.storey))
        recorder = Recorder(run)
        try:
            _write(store, run)
            yield recorder
        except BaseException as error:
            recorder.end(FAILED, reason(error))
            raise
        finally:
            _write(store, replace(recorder.run, ended_at=datetime.now(UTC)))
            lock.unlink(missing_ok=True)


def goes_on(store: str, run: Run) -> bool:
    """Return whether the process of a run is still at it."""
    return run.state == RUNNING and (is_held(_lock(store, run.id)) or is_leased(_lease(run)))


def read_runs(
    store: Path | str, building: str | None = None, storey: str | None = None
) -> list[Run]:
    """Return the runs of a store, or of one building or storey of it, by their start."""
    refresh(store, "/".join(("runs", *_folders(building, storey))))
    pattern = f"runs/building={building or '*'}/storey={storey or '*'}/*.parquet"
    runs = []
    for path in Path(store).glob(pattern):
        names = dict(part.split("=", 1) for part in path.parts[-3:-1])
        try:
            table = pq.read_table(path, partitioning=None)
            rows = table.drop_columns(_strange(table)).to_pylist()
            runs += [Run(building=names["building"], storey=names["storey"], **r) for r in rows]
        except (OSError, pa.ArrowException, TypeError) as error:
            raise StoreError(
                f"{path}: is no record of a run ({reason(error)}); remove the file"
            ) from error
    return sorted(runs, key=lambda run: (run.started_at, run.id))


def _strange(table: pa.Table) -> list[str]:
    """Return columns that are not a run's; one that came later than the file has its default."""
    return [name for name in table.column_names if name not in SCHEMA.names]


def last_runs(runs: list[Run]) -> list[Run]:
    """Return the last run of each storey that made something, by building and storey."""
    last = {(run.building, run.storey): run for run in runs if run.verb != EVALUATE}
    return [last[key] for key in sorted(last)]


def _write(store: str, run: Run) -> None:
    place = Place(store=store, run=run.id, building=run.building, storey=run.storey)
    row = {name: value for name, value in asdict(run).items() if name in SCHEMA.names}
    path = Path(store) / place.folder("runs") / f"{run.id}.parquet"
    replace_table(path, pa.Table.from_pylist([row], SCHEMA))
    share(store, path)


def storey_lock(store: Path | str, building: str, storey: str) -> Path:
    """Return the lock file of a storey: shared by runs that go on, alone for who prunes."""
    name = sha256(f"{building}/{storey}".encode()).hexdigest()[:32]
    return Path(store) / FOLDER / f"storey-{name}.lock"


def runs_lease(building: str, storey: str) -> str:
    """Return what the leases of a storey's runs are below."""
    return f"{building}/{storey}/run"


def pruning_lease(building: str, storey: str) -> str:
    """Return the lease of who prunes a storey."""
    return f"{building}/{storey}/pruning"


def _lease(run: Run) -> str:
    return f"{runs_lease(run.building, run.storey)}/{run.id}"


def _folders(building: str | None, storey: str | None) -> list[str]:
    """Return the folders that what is asked for lies in, as far as they are known."""
    if building is None:
        return []
    return [f"building={building}", *([f"storey={storey}"] if storey is not None else [])]


def _lock(store: str, run: str) -> Path:
    return Path(store) / FOLDER / f"run-{check_name(run)}.lock"
