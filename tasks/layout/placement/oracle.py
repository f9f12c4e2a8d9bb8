"""What a decoder that knew the true rooms would say: the bound of every grammar."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from grammars.model import Part, Rule
from storage.layout import HIDDEN, LINE_END, Layout
from storage.observations import Observations
from storage.rooms import Rooms
from tasks.layout.extraction.model import LineFrame

BEHIND_M = 0.6
"""How far behind a line its rooms are looked for: behind the corridor's wall."""
REACH_M = 10.0
"""How far past its ends, metres: rooms in corners."""
SHORTEST_M = 0.5
"""A room stands on a line along no less of it, metres."""
OBLIQUE_M = 0.05
"""A wall whose place along a line changes by more as it leaves the line is not square on it."""
THINNEST_M, THICKEST_M = 0.04, 0.5
"""Rooms beyond a row's end that are nearer or further have no wall in common with it, metres."""
SPREAD_M = 0.005
"""Standard deviation of a true width: what the plan itself is rounded to."""

Stretch = tuple[int, float, float]
"""A true room on a line: its number, from, to."""


def true_layout(
    observations: Observations,
    initial: Rooms,
    polygons: Sequence[Polygon],
    classes: Sequence[str],
    outer_m: float,
    same_m: float,
) -> Layout:
    """Return the true rooms along each line as if decoded, with their true widths.

    Placed like any layout it gives the truth-width oracle: what is left of the error when
    grammar and decoder make none. Its rules are the numbers of the true rooms; a grammar with
    `true_rules` knows their depths, too.

    Parameters
    ----------
    observations, initial : what was observed, and the initial model it was observed of
    polygons, classes : the true rooms, corridors among them
    outer_m : float
        Thickness of the outer walls that lines were laid with.
    same_m : float
        A true wall is the nearest observed one no further off, else hidden.

    Notes
    -----
    A true room stands on the line that the initial room it shares most area with stands on, if it
    lies behind that line at all.
    """
    stands = _standing(observations, initial, polygons)
    rows: list[tuple[object, ...]] = []
    for line, name in enumerate(observations.line_ids):
        frame = LineFrame.between(observations.starts[line], observations.ends[line])
        found = [s for s in _behind(frame, polygons, BEHIND_M) if line in stands[s[0]]]
        if not found:
            continue
        inner = [(below + above) / 2 for (_, _, below), (_, above, _) in pairwise(found)]
        low, high = _ends(frame, polygons, found, outer_m)
        true = np.array([low, *inner, high])
        cut_m = observations.cut_m[observations.lines == line]
        cuts = _matched(cut_m, true[1:-1], same_m)
        at = np.array([0.0, *np.where(cuts == HIDDEN, true[1:-1], np.append(cut_m, 0)[cuts])])
        at = np.append(at, frame.length)
        ids = np.array([LINE_END, *cuts, LINE_END])
        for i, (room, _, _) in enumerate(found):
            rows.append(
                (str(name), i, at[i], at[i + 1], ids[i], ids[i + 1], classes[room], str(room),
                 true[i + 1] - true[i])
            )  # fmt: skip
    return _layout(rows)


def true_rules(
    layout: Layout, observations: Observations, polygons: Sequence[Polygon]
) -> tuple[Rule, ...]:
    """Return the rules of a true layout: each true room's own width and depth."""
    frames = {
        str(name): LineFrame.between(start, end)
        for name, start, end in zip(
            observations.line_ids, observations.starts, observations.ends, strict=True
        )
    }
    rules = {}
    for i, name in enumerate(layout.rules):
        corners = shapely.get_coordinates(polygons[int(name)])
        depth = float(frames[str(layout.line_ids[i])].local(corners)[:, 1].max())
        part = Part(str(layout.classes[i]), float(layout.widths_m[i]), SPREAD_M, depth, SPREAD_M)
        rules[str(name)] = Rule(str(name), (part,), 1 / len(np.unique(layout.rules)))
    return tuple(rules.values())


def _layout(rows: list[tuple[object, ...]]) -> Layout:
    columns = list(zip(*rows, strict=True)) if rows else [()] * 9
    count = len(rows)
    return Layout(
        line_ids=np.array(columns[0], np.str_),
        hypotheses=np.zeros(count, np.int64),
        orders=np.array(columns[1], np.int64),
        from_m=np.array(columns[2], float),
        to_m=np.array(columns[3], float),
        from_cuts=np.array(columns[4], np.int64),
        to_cuts=np.array(columns[5], np.int64),
        classes=np.array(columns[6], np.str_),
        rules=np.array(columns[7], np.str_),
        parts=np.zeros(count, np.int64),
        widths_m=np.array(columns[8], float),
        spreads_m=np.full(count, SPREAD_M),
        posteriors=np.ones(count),
        from_posteriors=np.ones(count),
        to_posteriors=np.ones(count),
        undivided=np.ones(count),
        gains=np.full(count, np.inf),
        log_p=np.zeros(count),
    )


def _standing(
    observations: Observations, initial: Rooms, polygons: Sequence[Polygon]
) -> list[set[int]]:
    """Return the lines each true room stands on."""
    lines: list[set[int]] = []
    found = np.array(list(initial.polygons), object)
    for polygon in polygons:
        common = shapely.area(shapely.intersection(found, polygon))
        best = int(common.argmax()) if len(common) and common.max() > 0 else -2
        lines.append(set(observations.interval_lines[observations.rooms == best].tolist()))
    return lines


def _ends(
    frame: LineFrame, polygons: Sequence[Polygon], found: list[Stretch], outer_m: float
) -> tuple[float, float]:
    """Return where a row of true rooms ends: where the line does, if the wall there is oblique.

    At the axis of the wall between its last room and the next, be it of another row; else of an
    outer wall.
    """
    deeper = _behind(frame, polygons, 2 * BEHIND_M)
    (first, low, _), (last, _, high) = found[0], found[-1]
    own = {i: (below, above) for i, below, above in deeper}
    square = [
        first in own and abs(own[first][0] - low) < OBLIQUE_M,
        last in own and abs(own[last][1] - high) < OBLIQUE_M,
    ]
    before = [low - above for _, _, above in deeper if above < low + OBLIQUE_M]
    after = [below - high for _, below, _ in deeper if below > high - OBLIQUE_M]
    walls = [min(gaps, default=THICKEST_M) for gaps in (before, after)]
    half = [(t if THINNEST_M < t < THICKEST_M else outer_m) / 2 for t in walls]
    return (
        low - half[0] if square[0] else 0.0,
        high + half[1] if square[1] else frame.length,
    )


def _behind(frame: LineFrame, polygons: Sequence[Polygon], behind_m: float) -> list[Stretch]:
    reach = np.array([(-REACH_M, behind_m), (frame.length + REACH_M, behind_m)])
    probe = LineString(frame.building(reach))
    common = shapely.intersection(probe, np.array(list(polygons), object))
    parts, room = shapely.get_parts(common, return_index=True)
    found = []
    for i, part in zip(room.tolist(), parts, strict=True):
        s = frame.local(shapely.get_coordinates(part))[:, 0]
        inside = min(s.max(), frame.length) - max(s.min(), 0.0) if len(s) else 0.0
        if inside >= SHORTEST_M:
            found.append((i, float(s.min()), float(s.max())))
    return sorted(found, key=lambda stretch: stretch[1])


def _matched(
    cut_m: NDArray[np.float64], true_m: NDArray[np.float64], same_m: float
) -> NDArray[np.int64]:
    """Return the cut that each true wall is, each cut once and the nearest first."""
    found = np.full(len(true_m), HIDDEN, np.int64)
    away = np.abs(true_m[:, None] - cut_m[None, :])
    for wall, cut in sorted(np.argwhere(away <= same_m).tolist(), key=lambda p: away[*p]):
        if found[wall] == HIDDEN and cut not in found:
            found[wall] = cut
    return found
