"""All files of a store: those in its folder, and those at the address it shares."""

import os
from contextlib import suppress
from functools import cached_property
from pathlib import Path

from storage.remote import Object, remote


class Holdings:
    """The files of a store by name, wherever they are; the address is listed once."""

    def __init__(self, store: Path) -> None:
        self.store, self._at = store, remote()

    @staticmethod
    def here(store: Path, folder: str) -> dict[str, int]:
        """Return the bytes of the files in a folder of a store and below; no link is followed."""
        found = {}
        for path, _, names in os.walk(store / folder):
            for name in names:
                file = Path(path, name)
                with suppress(FileNotFoundError):
                    found[file.relative_to(store).as_posix()] = file.lstat().st_size
        return found

    def below(self, folder: str) -> dict[str, int]:
        """Return the bytes of the files in a folder and below, by name, sorted."""
        start = f"{folder}/"
        there = {n: o.size for n, o in self._objects.items() if n.startswith(start)}
        return dict(sorted((there | self.here(self.store, folder)).items()))

    def tables(self) -> set[str]:
        """Return the names of the folders in the store, links and hidden ones aside."""
        found = {name.partition("/")[0] for name in self._objects if "/" in name}
        with suppress(FileNotFoundError), os.scandir(self.store) as entries:
            found |= {entry.name for entry in entries if entry.is_dir(follow_symlinks=False)}
        return {name for name in found if not name.startswith(".")}

    def remove(self, name: str, *, dry_run: bool = False) -> int:
        """Remove a file wherever it is; return its bytes.

        Raises
        ------
        FileNotFoundError
            If it is nowhere.
        """
        path, there = self.store / name, self._objects.get(name)
        try:
            size = path.lstat().st_size
        except FileNotFoundError:
            if there is None:
                raise
            size = there.size
        if dry_run:
            return size
        if self._at is not None and there is not None:
            self._at.remove(name)
        path.unlink(missing_ok=True)
        return size

    @cached_property
    def _objects(self) -> dict[str, Object]:
        return {} if self._at is None else self._at.find("")
