"""Where the walls of a storey ought to stand, and which outline edges that would move."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.layout.placement.choice import Choice, choose, chosen, faces_right, fit_of
from tasks.layout.placement.depths import depth_moves
from tasks.layout.placement.facing import Facing
from tasks.layout.placement.guard import fuse_guarded
from tasks.layout.placement.hypotheses import hypotheses_of
from tasks.layout.placement.known_moves import known_moves
from tasks.layout.placement.modules import with_modules
from tasks.layout.placement.moves import Moves, all_moves
from tasks.layout.placement.outline import Edges
from tasks.layout.placement.seen import seen_share
from tasks.layout.placement.shapes import Shape
from tasks.layout.placement.sides import (
    Sides,
    find_sides,
    shared_walls,
    side_moves,
    thickness,
    with_end_walls,
)
from tasks.layout.placement.storey import Storey
from tasks.layout.placement.wall_kinds import partition_of
from tasks.layout.placement.widths import Chain, Fused, replace_chain


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Per row, where its rooms' side walls go."""

    fused: list[Fused]
    thickness_m: list[NDArray[np.float64]]
    """(n + 1,) each"""
    explained: list[NDArray[np.bool_]]
    """(n,) each, which rooms a rule explains that the guard did not refuse"""
    refused: list[NDArray[np.bool_]]
    """(n,) each, which rooms' rules the guard refused"""


def wishes_of(
    storey: Storey, shapes: Sequence[Shape], edges: Edges, facing: Facing
) -> tuple[Boundaries, Moves]:
    """Return where side walls go, and how far each edge ought to move for which wall."""
    params, rows = storey.params, storey.rows
    stands = np.zeros((len(rows), len(shapes)), bool)
    for r, row in enumerate(rows):
        stands[r] = [bool(np.isin(shape.sources, row.standing).any()) for shape in shapes]
    shape_of = np.full(len(storey.initial), -1)
    for i, shape in enumerate(shapes):
        shape_of[list(shape.sources)] = i
    seen = seen_share(edges, [shape.sources for shape in shapes], storey.walls)
    sides = find_sides(
        rows,
        edges,
        stands,
        shape_of,
        storey.grammar.partition_m,
        params.on_wall_m,
        params.firm_presence,
    )
    chains = with_end_walls(rows, sides, seen, params.face_sigma_m, params.end_sigma_m)
    found = _boundaries(storey, chains, sides, edges)
    if params.widths == "observed":
        return found, all_moves()
    wishes = [
        side_moves(
            rows,
            sides,
            chains,
            found.fused,
            found.thickness_m,
            found.explained,
            params.end_sigma_m,
        )
    ]
    if params.widths == "fuse":
        wishes += _depth_wishes(storey, shapes, edges, stands, seen, found)
        known = _known_wishes(storey, shapes, edges, facing, seen)
        wishes = [_of_others(some, known) for some in wishes] + [known]
    return found, all_moves(*wishes)


def _known_wishes(
    storey: Storey, shapes: Sequence[Shape], edges: Edges, facing: Facing, seen: NDArray[np.float64]
) -> Moves:
    """Return how edges ought to move onto walls that a grammar of this building knows."""
    params = storey.params
    return known_moves(
        storey.known,
        edges,
        [shape.sources[0] for shape in shapes],
        facing,
        seen,
        (params.hidden_m, params.beyond_m),
        (params.known_sigma_m, params.face_sigma_m, params.drift_m),
        params.limit,
    )


def _of_others(moves: Moves, known: Moves) -> Moves:
    """Return the wishes for edges that lie on no known wall."""
    return moves.at(~np.isin(moves.edge, known.edge))


def _boundaries(storey: Storey, chains: list[Chain], sides: Sides, edges: Edges) -> Boundaries:
    params, rows, grammar = storey.params, storey.rows, storey.grammar
    refused = [np.zeros(len(row.decoded), bool) for row in rows]
    partition = partition_of(rows, grammar.partition_m, grammar.partition_spread_m)
    walls = [
        hypotheses_of(row, partition, chain.sigma_m, grammar.partition_spread_m)
        for row, chain in zip(rows, chains, strict=True)
    ]
    choices = [Choice.first(len(row.decoded)) for row in rows]
    match params.widths:
        case "fuse":
            chains = [with_modules(chain, grammar.module) for chain in chains]
            fit = fit_of(chains, walls)
            choices = [choose(c, w, fit) for c, w in zip(chains, walls, strict=True)]
            chains = [chosen(*of, fit) for of in zip(chains, walls, choices, strict=True)]
            firm = [
                row.firm(params.firm_presence) & faces_right(w, c)
                for row, w, c in zip(rows, walls, choices, strict=True)
            ]
            doubted = [choice.doubted for choice in choices]
            ties = shared_walls(rows, sides, edges)
            fused, refused = fuse_guarded(
                chains, ties, firm, doubted, params.limit, params.most_wrong
            )
        case "replace":
            fused = [replace_chain(chain) for chain in chains]
        case "observed":
            fused = [Fused(chain.observed_m, chain.sigma_m) for chain in chains]
    ruled = [~np.isnan(chain.width_m) for chain in chains]
    explained = [known & ~no for known, no in zip(ruled, refused, strict=True)]
    thick = [
        thickness(row, one, wall, choice)
        for row, one, wall, choice in zip(rows, fused, walls, choices, strict=True)
    ]
    return Boundaries(fused, thick, explained, refused)


def _depth_wishes(
    storey: Storey,
    shapes: Sequence[Shape],
    edges: Edges,
    stands: NDArray[np.bool_],
    seen: NDArray[np.float64],
    found: Boundaries,
) -> list[Moves]:
    """Return how fronts and backs ought to move, of rooms that rules explain."""
    known = np.array(
        [bool(s.decoded) and bool(found.explained[s.row][s.all_decoded].all()) for s in shapes],
        bool,
    )
    params = storey.params
    wishes = []
    for r, row in enumerate(storey.rows):
        depths = [
            storey.rule_depth_m(r, shape.all_decoded) if shape.row == r else (np.nan, np.nan)
            for shape in shapes
        ]
        depth, spread = np.array(depths).reshape(-1, 2).T
        first = np.array([shape.sources[0] for shape in shapes], np.int64)
        wishes.append(
            depth_moves(
                r,
                row,
                edges,
                first,
                depth,
                spread,
                stands[r] & known,
                seen,
                params.face_sigma_m,
                params.align_m,
                params.hidden_m,
                params.limit,
            )
        )
    return wishes
