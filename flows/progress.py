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
    """One bar per storey: stages done of stages to do; and one per experiment, of its repeats."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._bars: dict[str, BarId] = {}

    def expect(self, key: str, title: str, total: int) -> None:
        """Show a bar of so many steps; a key stands for a run or an experiment."""
        self._bars[key] = self._progress.add_task(title, total=total, last="")

    def advance(self, key: str, last: str) -> None:
        """Show that a step was done."""
        if (bar := self._bars.get(key)) is not None:
            self._progress.update(bar, advance=1, last=last)

    def remove(self, key: str) -> None:
        """Show a bar no more."""
        if (bar := self._bars.pop(key, None)) is not None:
            self._progress.remove_task(bar)

    def stage_ended(self, place: Place, row: StageRow) -> None:
        """Show that a stage has ended."""
        last = f"{row.stage} {row.scan or ''} {row.outcome} {row.wall_s:.1f} s"
        self.advance(place.run, last)


_displays: list[Display] = []


def expect(place: Place, stages: int, title: str | None = None) -> None:
    """Say how many stages a storey will run, if anyone watches; None: it is called as it is."""
    for display in _displays:
        display.expect(place.run, title or f"{place.building}/{place.storey}", stages)


def gather(experiment: str, title: str, repeats: int) -> None:
    """Say how many repeats an experiment will run, if anyone watches."""
    for display in _displays:
        display.expect(experiment, title, repeats)


def advance(key: str, last: str) -> None:
    """Say that a step of what has a bar was done, and which."""
    for display in _displays:
        display.advance(key, last)


def ended(place: Place, experiment: str) -> None:
    """Say that a repeat of an experiment has ended: it is one of many, its bar goes."""
    for display in _displays:
        display.remove(place.run)
        display.advance(experiment, "")


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
            with watched(display.stage_ended):
                yield
        finally:
            _displays.remove(display)
