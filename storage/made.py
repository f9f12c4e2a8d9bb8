"""What a run has made: references to its artifacts, by table and scan."""

from hashlib import sha256
from pathlib import Path

import pyarrow.parquet as pq

from storage.artifacts import Place, Ref
from storage.errors import DamagedArtifact
from storage.stages import of_run

WHOLE = ""
"""Stands for the scan of what is made of a whole storey."""


def made(place: Place) -> dict[str, dict[str, Ref]]:
    """Return what a run of a storey has made, computed or from the cache.

    Returns
    -------
    dict
        By table, then by scan in the order of their names. Of what several stages made of one
        table, the last.

    Raises
    ------
    DamagedArtifact
        If an artifact is missing or is not what its name says.
    """
    last: dict[tuple[str, str], str] = {}
    for row in of_run(place):
        for uri in row.outputs:
            last[uri.partition("/")[0], row.scan or WHOLE] = uri
    found: dict[str, dict[str, Ref]] = {}
    for table, scan in sorted(last):
        found.setdefault(table, {})[scan] = _ref(Path(place.store), table, last[table, scan])
    return found


def _ref(store: Path, table: str, uri: str) -> Ref:
    path = store / uri
    try:
        digest = sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise DamagedArtifact(
            f"{path}: the artifact cannot be read ({error.strerror}); run again, it is remade"
        ) from error
    if not digest.startswith(path.stem):
        raise DamagedArtifact(
            f"{path}: the artifact was changed or cut after it was written; run again, it is remade"
        )
    return Ref(uri=uri, sha256=digest, rows=pq.read_metadata(path).num_rows, table=table)
