"""Reference lines in a measured storey (Sec. 4.2.2): the grammar's, or the corridors' own."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from grammars.model import Grammar, ReferenceLine
from storage.errors import MapSenseError
from tasks.layout.extraction.alignment import AlignParams, align, fit_both_ways
from tasks.layout.extraction.corridors import CorridorParams, find_corridors, straight_runs
from tasks.layout.extraction.model import LineFrame, Model
from tasks.params import Params


class LineParams(Params):
    """Where reference lines come from."""

    lines: Literal["best", "corridors", "aligned", "grammar"] = "best"
    """`corridors`: along the walls of the storey's own; `aligned`: those of the grammar, moved and
    turned as a whole onto these; `grammar`: the grammar's, as they are (Sec. 4.2.2); `best`: the
    grammar's if they are this building's, as they are or else aligned, and else `corridors`."""
    storey: str = ""
    """Storey whose lines are taken of the grammar; empty: its only one, or with `best` that whose
    lines fit best."""
    corridor: CorridorParams = CorridorParams()
    """What is taken for a corridor."""
    align: AlignParams = AlignParams()
    """How lines are laid onto the corridors' walls."""


@dataclass(frozen=True, eq=False)
class ReferenceLines:
    """l lines, rooms to the left of one who walks them."""

    ids: tuple[str, ...]
    ends: NDArray[np.float64]
    """(l, 2, 2), start and end, building frame"""
    corridors: NDArray[np.int64]
    """rooms of the initial model that are corridors"""
    given: bool
    """whether the grammar says that rooms stand there, seen or not"""

    def frames(self) -> list[LineFrame]:
        """Return the frame of each line."""
        return [LineFrame.between(*ends) for ends in self.ends]


def place_lines(model: Model, grammar: Grammar, params: LineParams) -> ReferenceLines:
    """Return the reference lines of a storey.

    Raises
    ------
    MapSenseError
        If the grammar's lines are asked for and it has none, or several storeys', or they do not
        fit the storey's corridors.
    """
    corridors = find_corridors(model, params.corridor)
    runs = straight_runs(model.rooms.polygons[corridors], params.corridor)
    if params.lines == "best":
        best = _best(grammar, runs, corridors, params)
        if best is not None:
            return best
    if params.lines in ("best", "corridors"):
        ids = tuple(f"run-{i + 1}" for i in range(len(runs)))
        return ReferenceLines(ids, runs, corridors, given=False)
    lines = _lines_of(grammar, params.storey)
    ends = _ends(lines)
    if params.lines == "aligned":
        ends = align(ends, runs, f"grammar '{grammar.name}'", params.align).apply(ends)
    return ReferenceLines(_ids(lines), ends, corridors, given=True)


def _best(
    grammar: Grammar, runs: NDArray[np.float64], corridors: NDArray[np.int64], params: LineParams
) -> ReferenceLines | None:
    """Return the grammar's lines where they fit, as given or else aligned; None if none do."""
    storeys = dict.fromkeys(line.storey for line in grammar.lines)
    asked = [s for s in storeys if not params.storey or s == params.storey]
    of_storey = [tuple(line for line in grammar.lines if line.storey == s) for s in asked]
    for moved in (False, True):
        best, share = None, 0.0
        for lines in of_storey if len(runs) else ():
            ends = _ends(lines)
            try:
                if moved:
                    ends = align(ends, runs, grammar.name, params.align).apply(ends)
            except MapSenseError:
                continue  # these do not fit, others may
            fits = fit_both_ways(ends, runs, params.align)
            # lines that are moved may come to lie anywhere: more is asked of them
            if fits > share and (not moved or fits >= params.align.own_covered):
                best, share = ReferenceLines(_ids(lines), ends, corridors, given=True), fits
        if best is not None:
            return best
    return None


def _ids(lines: tuple[ReferenceLine, ...]) -> tuple[str, ...]:
    return tuple(line.id for line in lines)


def _ends(lines: tuple[ReferenceLine, ...]) -> NDArray[np.float64]:
    return np.array([(line.start, line.end) for line in lines], float)


def _lines_of(grammar: Grammar, storey: str) -> tuple[ReferenceLine, ...]:
    storeys = sorted({line.storey for line in grammar.lines})
    if not storeys:
        raise MapSenseError(
            f"grammar '{grammar.name}' has no reference lines; take those of the corridors: "
            "lines = 'corridors'"
        )
    if storey and storey not in storeys:
        raise MapSenseError(
            f"grammar '{grammar.name}' has no reference lines of storey '{storey}', only of "
            f"{', '.join(storeys)}; name one of them, or set lines = 'corridors'"
        )
    if not storey and len(storeys) > 1:
        raise MapSenseError(
            f"grammar '{grammar.name}' has reference lines of several storeys, "
            f"{', '.join(storeys)}; name one of them"
        )
    return tuple(line for line in grammar.lines if line.storey == (storey or storeys[0]))
