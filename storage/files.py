"""Files that are there whole or not at all."""

import contextlib
import os
import uuid
from pathlib import Path

from storage.errors import StoreError


def temporary_in(folder: Path) -> Path:
    """Return a new name for what is still being written: no pattern of whole files has it."""
    return folder / f".{os.getpid()}-{uuid.uuid4().hex[:12]}.tmp"


def write_whole(path: Path, data: bytes, what: str) -> None:
    """Write a file beside its target, sync, rename: a reader sees all of it or nothing.

    Raises
    ------
    StoreError
        Naming the file, `what` it was to hold, and the remedy.
    """
    temporary = temporary_in(path.parent)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        with contextlib.suppress(OSError):  # what stopped the writing may stop this too
            temporary.unlink()
        raise StoreError(
            f"{path}: cannot write the {what} ({error.strerror or error}); make the folder "
            "writable, free space on its disk, or choose another with --out"
        ) from error
