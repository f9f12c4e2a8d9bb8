"""What stages read besides artifacts: a person's scan, a plan, a grammar, a forest."""

from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel, ConfigDict


class Source(BaseModel):
    """A scan as people have it. A stage's key takes the hash of its bytes, not its path."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    """Name of the scan: a folder of the store is named by it."""
    path: str
    """The file, or the folder of one scan (depth sequence, scan bundle)."""
    sha256: str
    """Hash over the scan's files: their names relative to `path` and their bytes."""
    size_bytes: int
    """Bytes of all its files."""


def file_source(path: Path, name: str) -> Source:
    """Return one file as a stage's input: named, and known by the hash of its bytes.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    data = path.read_bytes()
    return Source(name=name, path=str(path), sha256=sha256(data).hexdigest(), size_bytes=len(data))
