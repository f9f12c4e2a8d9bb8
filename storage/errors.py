"""Errors a person can act on: what is wrong, where, and the remedy."""

from pathlib import Path


class MapSenseError(Exception):
    """Base of every error whose text is meant for the person who runs MapSense."""


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
