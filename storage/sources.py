"""What a person brings: the file or folder one scan is read from."""

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
