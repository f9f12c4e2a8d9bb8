"""Files that are there whole or not at all."""

import contextlib
import os
import uuid
from pathlib import Path

from storage.errors import StoreError


def write_whole(path: Path, data: bytes, what: str) -> None:
    """Write a file beside its target, sync, rename: a reader sees all of it or nothing.

    Raises
    ------
    StoreError
        Naming the file, `what` it was to hold, and the remedy.
    """
    temporary = path.with_name(f".{os.getpid()}-{uuid.uuid4().hex[:12]}.tmp")
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
