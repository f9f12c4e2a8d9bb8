"""Progress of long work, on stderr, for a person who watches."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.progress import TaskID as BarId

from storage.artifacts import Place
from storage.stages import StageRow
from tasks.stage.ledger import watched


class Display:
    """One bar per storey: stages done of stages to do."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._bars: dict[str, BarId] = {}

    def expect(self, place: Place, stages: int) -> None:
        """Show a storey of which a number of stages will run."""
        title = f"{place.building}/{place.storey}"
        self._bars[place.run] = self._progress.add_task(title, total=stages, last="")

    def advance(self, place: Place, row: StageRow) -> None:
        """Show that a stage has ended."""
        if (bar := self._bars.get(place.run)) is not None:
            last = f"{row.stage} {row.scan or ''} {row.outcome} {row.wall_s:.1f} s"
            self._progress.update(bar, advance=1, last=last)


_displays: list[Display] = []


def expect(place: Place, stages: int) -> None:
    """Say how many stages a storey will run, if anyone watches."""
    for display in _displays:
        display.expect(place, stages)


@contextmanager
def shown(wanted: bool) -> Iterator[None]:
    """Show progress meanwhile, if it is wanted and stderr is a terminal."""
    if not (wanted and sys.stderr.isatty()):
        yield
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[last]}"),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        display = Display(progress)
        _displays.append(display)
        try:
            with watched(display.advance):
                yield
        finally:
            _displays.remove(display)
