"""The quality of one scan: how incomplete, how skewed, accepted or not (Sec. 3.2)."""

from dataclasses import dataclass, fields

import pyarrow as pa

from storage.artifacts import Kind, column, register, schema


@dataclass(frozen=True)
class Quality:
    """What the quality gate found of one scan.

    A scan without snapshots is *not assessed*: its probabilities and `accepted` are None.
    """

    snapshots: int
    """snapshots with a pose"""
    incomplete: int
    """those of them with too few points"""
    p_in: float | None
    """incompleteness, 0 to 1"""
    p_sk: float | None
    """skewness, 0 to 1: mean over the snapshots (Eq. 2)"""
    p_sk_worst: float | None
    """skewness of the worst snapshot"""
    p_sum: float | None
    """both fused (Eq. 3)"""
    t_q: float
    """quality requirement of the sensing query: greatest p_sum accepted"""
    accepted: bool | None
    """Eq. 4"""
    reason: str
    """'' if accepted, else 'not assessed' or what there is too much of: 'incomplete', 'skewed',
    'incomplete and skewed'"""


SCHEMA = schema(
    "quality",
    [
        column("snapshots", pa.int64(), "snapshots with a pose"),
        column("incomplete", pa.int64(), "snapshots with too few points"),
        column("p_in", pa.float64(), "incompleteness; null: not assessed", nullable=True),
        column("p_sk", pa.float64(), "skewness, mean over the snapshots (Eq. 2)", nullable=True),
        column("p_sk_worst", pa.float64(), "skewness of the worst snapshot", nullable=True),
        column("p_sum", pa.float64(), "both fused (Eq. 3)", nullable=True),
        column("t_q", pa.float64(), "quality requirement: greatest p_sum accepted"),
        column("accepted", pa.bool_(), "Eq. 4; null: not assessed", nullable=True),
        column("reason", pa.string(), "why it was not accepted; '' if it was"),
    ],
)


def to_table(quality: Quality) -> pa.Table:
    """Return the one-row table of a scan's quality."""
    return pa.Table.from_pylist(
        [{f.name: getattr(quality, f.name) for f in fields(quality)}], SCHEMA
    )


def from_table(table: pa.Table) -> Quality:
    """Return the quality a one-row table holds."""
    return Quality(**table.to_pylist()[0])


QUALITY = register(Kind("quality", Quality, SCHEMA, to_table, from_table))
