"""What a wall's faces may mean: several hypotheses of where it stands, each with its evidence.

A face that was seen may be the wall's, or the front of a shelf that stands before it. Two opposite
faces may be those of a partition, of a thicker wall, or only one of them is the wall's; behind a
single face may be a partition or a thicker wall. Each hypothesis says where the wall's centre is, a
normal distribution, how thick the wall is, and how probable what was seen is with it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from storage.layout import LINE_END
from tasks.layout.placement.decoded_rows import DecodedRow
from tasks.layout.placement.wall_kinds import Partition, face_sigma_m

P_FURNITURE = 0.01
"""Probability that what was taken for a wall's face is something before it. Assumption."""
DEEPEST_M = 0.6
"""Depth of what stands before walls is uniform up to this, metres: cabinets (DIN 4545)."""
P_THICK = 0.2
"""Probability that a wall along a line is no partition. Assumption."""
THICK_M, THICK_SPREAD_M = 0.24, 0.07
"""Thickness of such walls where only one face was seen, metres: masonry of 17.5 to 30 cm (DIN
4172)."""
P_END_OTHER, END_SPREAD_M = 0.5, 0.02
"""Probability that a wall that a line ends at is not as thick as it was laid, and the spread of its
thickness where it is, metres: it is laid as a partition or an outer wall, and may bear. Assumption.
"""
THICKEST_M = 0.5
"""Of two faces that are not a partition's any distance up to this is alike, metres."""
ASTRAY_M = 0.3
"""Standard deviation of a wall of which no face was right, metres."""


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """h hypotheses of one wall."""

    centre_m: NDArray[np.float64]
    """(h,), along the line"""
    sigma_m: NDArray[np.float64]
    """(h,), standard deviation of `centre_m`"""
    log_p: NDArray[np.float64]
    """(h,), logarithm of the prior and of the density of what was seen, but for where it is"""
    thickness_m: NDArray[np.float64]
    """(h,)"""
    gain: NDArray[np.float64]
    """(h,), by how much thicker the wall is per metre that its centre is further along the line:
    where one of its faces is known"""
    faces_right: NDArray[np.bool_]
    """(h,), whether every face that was seen is the wall's"""

    def __len__(self) -> int:
        return len(self.centre_m)

    def thickness_at(self, which: int, position_m: float) -> float:
        """Return the expected thickness by one hypothesis of a wall that stands somewhere."""
        off = position_m - self.centre_m[which]
        return float(self.thickness_m[which] + self.gain[which] * off)


def hypotheses_of(row: DecodedRow, partition: Partition, chain_sigma_m: NDArray[np.float64],
                  spread_m: float) -> list[Hypotheses]:  # fmt: skip
    """Return the hypotheses of each boundary of a row.

    Parameters
    ----------
    partition : what partitions of this storey are
    chain_sigma_m : (n + 1,) float
        Standard deviations of the boundaries as observed.
    spread_m : float
        Spread of the partitions' thickness by the grammar, as the deviations were made with.
    """
    found = []
    for k, cut in enumerate(row.cuts):
        at, sigma = float(row.chain.observed_m[k]), float(chain_sigma_m[k])
        low, high = row.faces_m[k]
        seen = ~np.isnan(row.faces_m[k])
        if cut == LINE_END and not seen.any():
            entries = [
                (at, sigma, np.log1p(-P_FURNITURE), 0.0, 0.0, True),
                (at, ASTRAY_M, np.log(P_FURNITURE), 0.0, 0.0, False),
            ]
        elif seen.all():
            entries = _two_faced(float(low), float(high), sigma, partition)
        elif seen.any():
            side = 1 if seen[0] else -1
            face = float(low if seen[0] else high)
            kinds = _kinds(partition)
            if cut == LINE_END:
                laid = 2 * abs(at - face), END_SPREAD_M, 1 - P_END_OTHER
                kinds = laid, (THICK_M, THICK_SPREAD_M, P_END_OTHER)
            entries = _one_faced(face, side, face_sigma_m(sigma, 1, spread_m), kinds)
        else:
            entries = [(at, sigma, 0.0, partition.thickness_m, 0.0, True)]
        columns = [np.array(column) for column in zip(*entries, strict=True)]
        found.append(Hypotheses(*columns))
    return found


_Entry = tuple[float, float, float, float, float, bool]


def _two_faced(low: float, high: float, sigma: float, partition: Partition) -> list[_Entry]:
    face = face_sigma_m(sigma, 2, 0.0)
    apart, thick, spread = high - low, partition.thickness_m, partition.spread_m
    noise = np.sqrt(2) * face * partition.noise
    right = 2 * np.log1p(-P_FURNITURE)
    as_one = norm.logpdf(apart, thick, np.hypot(noise, spread)) + np.log1p(-P_THICK)
    weight = spread**2 / (spread**2 + noise**2)
    mean = thick + weight * (apart - thick)
    middle = (low + high) / 2
    entries: list[_Entry] = [(middle, sigma, right + float(as_one), mean, 0.0, True)]
    if 0 < apart <= THICKEST_M:
        as_other = np.log(P_THICK / THICKEST_M)
        entries.append((middle, sigma, right + float(as_other), apart, 0.0, True))
    # furniture lets a wall look thicker
    before = np.log(P_FURNITURE) + norm.logcdf((apart - thick) / np.hypot(noise, spread))
    one_right = float(before - np.log(DEEPEST_M) + np.log1p(-P_FURNITURE))
    for side, at in ((1, low), (-1, high)):
        own = _one_faced(at, side, face, _kinds(partition))[0]
        entries.append((*own[:2], one_right, *own[3:5], False))
    return entries


_Kind = tuple[float, float, float]


def _kinds(partition: Partition) -> tuple[_Kind, ...]:
    """Return thickness, spread and share of the kinds of walls along a line."""
    return (
        (partition.thickness_m, partition.spread_m, 1 - P_THICK),
        (THICK_M, THICK_SPREAD_M, P_THICK),
    )


def _one_faced(face_m: float, side: int, sigma: float, kinds: tuple[_Kind, ...]) -> list[_Entry]:
    """Return hypotheses of a wall of which one face was seen: the lower with side 1, or the upper.

    With x the centre, t the thickness and y the face, x = y + side t / 2: given x, the expectation
    of t is linear in x.
    """
    entries: list[_Entry] = []
    for thick, spread, share in kinds:
        variance = sigma**2 + spread**2 / 4
        log_p = np.log1p(-P_FURNITURE) + np.log(share)
        gain = side * spread**2 / 2 / variance
        entries.append((face_m + side * thick / 2, np.sqrt(variance), log_p, thick, gain, True))
    thick, behind = kinds[0][0], face_m + side * (kinds[0][0] + DEEPEST_M) / 2
    deviation = DEEPEST_M / np.sqrt(12)
    entries.append((behind, deviation, np.log(P_FURNITURE), thick, 0.0, False))
    return entries
