"""What the last successful run of a storey took, so that the next one knows what is new.

One file per storey, written anew after each successful run; lost, it only costs a run that finds
everything in the cache.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from storage.artifacts import column, replace_table, schema
from storage.errors import StoreError
from storage.remote import refresh, share
from storage.stages import reason

TABLE = "sources"


@dataclass(frozen=True)
class MappedSource:
    """A scan that was taken."""

    url: str
    """where it was found: a path, or an address such as s3://bucket/key"""
    stamp: str
    """sizes and times of its files: as long as it stays, the content need not be read again"""
    sha256: str
    """of its content, as of `storage.sources.Source`; '' of one that could not be read"""


@dataclass(frozen=True)
class MappedSources:
    """What a successful run of a storey took."""

    run: str
    settings: str
    """what the parameters it was asked for are known by"""
    sources: tuple[MappedSource, ...]


SCHEMA = schema(
    TABLE,
    [
        column("run", pa.string(), "the run, as in table runs"),
        column("settings", pa.string(), "hash of the parameters it was asked for"),
        column("url", pa.string(), "path or address of the scan"),
        column("stamp", pa.string(), "sizes and times of its files"),
        column("sha256", pa.string(), "hash of its content; '' if it could not be read"),
    ],
)


def write_mapped_sources(store: str, building: str, storey: str, mapped: MappedSources) -> None:
    """Write what a run took, in place of what the one before took."""
    about = {"run": mapped.run, "settings": mapped.settings}
    rows = [about | asdict(source) for source in mapped.sources]
    path = _path(store, building, storey)
    replace_table(path, pa.Table.from_pylist(rows, SCHEMA))
    share(store, path)


def read_mapped_sources(store: str, building: str, storey: str) -> MappedSources | None:
    """Return what the last successful run took; None if there was none.

    Raises
    ------
    StoreError
        If the file is none of ours.
    """
    path = _path(store, building, storey)
    refresh(store, path.parent.relative_to(store).as_posix())
    try:
        rows = pq.read_table(path, partitioning=None).select(SCHEMA.names).to_pylist()
    except FileNotFoundError:
        return None
    except (OSError, pa.ArrowException, KeyError) as error:
        raise StoreError(
            f"{path}: is no record of a storey's sources ({reason(error)}); remove the file, the "
            "storey is then mapped from the cache"
        ) from error
    if not rows:
        return None
    sources = (MappedSource(row["url"], row["stamp"], row["sha256"]) for row in rows)
    return MappedSources(rows[0]["run"], rows[0]["settings"], tuple(sources))


def _path(store: str, building: str, storey: str) -> Path:
    return Path(store) / TABLE / f"building={building}" / f"storey={storey}" / "last.parquet"
