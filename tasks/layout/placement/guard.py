"""The guard: a rule that contradicts what was well observed is refused.

A boundary is firm where both faces of its wall were seen and the wall surely divides rooms. Of a
room between two firm boundaries the rule is refused if its width is further from the observed one
than `limit` standard deviations of their difference. What is left is fused; while a firm boundary
would be moved by more than `limit` of its own standard deviations, the rule next to it that
is strained most is refused too. So no grammar moves a well-observed wall further than its
own uncertainty allows. And where the rules of most rooms
between firm boundaries are contradicted, the grammar is another building's: none has a say.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tasks.layout.placement.widths import Chain, Fused, Tie, fuse_chains

ENOUGH = 4
"""Rooms between firm boundaries from which a grammar as a whole can be told to be wrong."""

Masks = list[NDArray[np.bool_]]


def contradicted(chain: Chain, firm: NDArray[np.bool_], limit: float) -> NDArray[np.bool_]:
    """Return which rooms' widths contradict the distance of their two firm boundaries, (n,)."""
    variance = chain.sigma_m[1:] ** 2 + chain.sigma_m[:-1] ** 2 + chain.spread_m**2
    off = np.abs(np.diff(chain.observed_m) - chain.width_m)
    with np.errstate(invalid="ignore"):  # a room without a rule contradicts nothing
        return _testable(chain, firm) & (off > limit * np.sqrt(variance))


def _testable(chain: Chain, firm: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which rooms have a rule and two firm boundaries."""
    return firm[1:] & firm[:-1] & ~np.isnan(chain.width_m)


def fuse_guarded(
    chains: Sequence[Chain],
    ties: Sequence[Tie],
    firm: Sequence[NDArray[np.bool_]],
    doubted: Sequence[NDArray[np.bool_]],
    limit: float,
    most: float,
) -> tuple[list[Fused], Masks]:
    """Return the fused boundaries of all lines, and per line the rooms whose rules were refused.

    Parameters
    ----------
    firm : per line (n + 1,) bool
        Which boundaries are well observed.
    doubted : per line (n,) bool
        Rooms whose rules are refused in any case.
    limit : float
        Standard deviations, see above.
    most : float
        Share of the rules between firm boundaries above which contradictions rule out them all.
    """
    refused = [
        contradicted(c, f, limit) | no for c, f, no in zip(chains, firm, doubted, strict=True)
    ]
    tested = sum(int(_testable(c, f).sum()) for c, f in zip(chains, firm, strict=True))
    wrong = sum(
        int((_testable(c, f) & no).sum()) for c, f, no in zip(chains, firm, refused, strict=True)
    )
    if tested >= ENOUGH and wrong > most * tested:
        refused = [~np.isnan(chain.width_m) for chain in chains]
    while True:
        left = [chain.without(no) for chain, no in zip(chains, refused, strict=True)]
        fused = fuse_chains(left, ties)
        worse = [
            _most_strained(c, one, f, limit) for c, one, f in zip(left, fused, firm, strict=True)
        ]
        if all(room is None for room in worse):
            return fused, refused
        for no, room in zip(refused, worse, strict=True):
            if room is not None:
                no[room] = True


def _most_strained(chain: Chain, fused: Fused, firm: NDArray[np.bool_], limit: float) -> int | None:
    """Return the room whose rule pulls most at a firm boundary that moved too far."""
    moved = np.abs(fused.position_m - chain.observed_m) > limit * chain.sigma_m
    pulled = firm & moved
    strain = np.abs(np.diff(fused.position_m) - chain.width_m) / chain.spread_m
    strain = np.where(pulled[1:] | pulled[:-1], np.nan_to_num(strain, nan=-1.0), -1.0)
    return int(strain.argmax()) if (strain >= 0).any() else None
