"""Errors a person can act on: what is wrong, where, and the remedy."""

import os
import re
from pathlib import Path

_SECRET = re.compile(r"secret|token|passw|credential|(api|access|private)_?key", re.IGNORECASE)
_USER = re.compile(r"://[^/\s@]+@")
_LEAST = 6
"""Characters of a secret; what is shorter would be found in any text."""


class MapSenseError(Exception):
    """Base of every error whose text is meant for the person who runs MapSense.

    Such texts end in rows, logs and summaries: what they quote of others' holds no secrets.
    """

    def __init__(self, *args: object) -> None:
        super().__init__(*(redacted(arg) if isinstance(arg, str) else arg for arg in args))


class InputError(MapSenseError):
    """Bad input: names the file, the field and the remedy in one sentence.

    Parameters
    ----------
    path : the file or folder at fault
    field : what in it is wrong (a header field, a column, a value)
    remedy : what to do about it
    """

    def __init__(self, path: Path | str, field: str, remedy: str) -> None:
        super().__init__(f"{path}: {field}; {remedy}")
        self.path, self.field, self.remedy = str(path), field, remedy

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return InputError, (self.path, self.field, self.remedy)


class StoreError(MapSenseError):
    """The store cannot be read or written."""


class DamagedArtifact(StoreError):
    """An artifact is missing, or its bytes are not those its reference names."""


def redacted(text: str) -> str:
    """Return a text without the secrets of this process's environment, and addresses' users."""
    secrets = {v for n, v in os.environ.items() if _SECRET.search(n) and len(v) >= _LEAST}
    for secret in sorted(secrets, key=len, reverse=True):
        text = text.replace(secret, "***")
    return _USER.sub("://***@", text)
