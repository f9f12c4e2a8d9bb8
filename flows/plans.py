"""Plans as inputs of stages."""

from hashlib import sha256
from pathlib import Path

from storage.sources import Source


def plan_source(path: Path) -> Source:
    """Return a plan's file as a stage's input: named, and known by the hash of its bytes."""
    data = path.read_bytes()
    return Source(
        name="plan", path=str(path), sha256=sha256(data).hexdigest(), size_bytes=len(data)
    )
