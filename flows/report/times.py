"""Fig. 18c: seconds per stage against points."""

import numpy as np

from flows.report.data import Answers, Row, column, grouped
from tasks.exports.figures.times import StageTimes, draw_times
from tasks.exports.report import Section, Table

OF_THE_PAPER = ("planes", "doors", "furniture")
"""The stages of the paper's figure, drawn first."""
OTHERS = frozenset({"room_errors", "detections", "wall_quality", "plane_detections"})
"""Stages that measure what others made."""
LEAST_RUNS = 3
"""Fewer runs are no distribution: they are in the table alone."""


def time_section(answers: Answers) -> Section:
    """Return the seconds of each stage that works on points."""
    found = grouped(answers.rows["times"], lambda row: str(row["stage"]))
    rows = {name: part for name, part in found.items() if name not in OTHERS}
    order = sorted(rows, key=lambda name: (_place(name), -rows[name][0]["total_s"], name))
    stages = [_stage(name, rows[name]) for name in order]
    drawn = [stage for stage in stages if stage.runs >= LEAST_RUNS]
    missing = [
        f"No seconds of {name}: no run has computed such a stage yet."
        for name in OF_THE_PAPER
        if name not in rows
    ]
    if stages and not drawn:
        missing.append(f"No stage was computed {LEAST_RUNS} times: there is nothing to draw.")
    columns = ("stage", "runs", "total s", "median s", "longest s", "slope", "s per 10⁶ points")
    table = Table(
        "Seconds of computed stages (median and longest: of those drawn)",
        columns,
        tuple(
            (
                stage.stage,
                stage.runs,
                round(rows[stage.stage][0]["total_s"], 2),
                round(float(np.median(stage.seconds)), 4),
                round(float(stage.seconds.max()), 3),
                None if np.isnan(stage.exponent) else round(stage.exponent, 3),
                _per_million(stage),
            )
            for stage in stages
        ),
    )
    return Section(
        key="figure-18c",
        title="Fig. 18c: seconds per stage against points",
        text=(
            "Measured wall time of each stage, on whatever machine ran it. Points are those the "
            "stage reads; else those it makes; else those of the scans it works on. The slope is "
            "the power of points that seconds grow with, fitted on log-log axes to all runs: 1 is "
            "linear. Thin lines are the other stages.",
            "In the paper doors take longest: up to 94 % more than planes and 99 % more than "
            "furniture.",
        ),
        badges=("measured seconds",) if stages else (),
        pictures=(draw_times("figure_18c", drawn),) if drawn else (),
        tables=(table,) if stages else (),
        missing=tuple(missing),
        queries=answers.quoted("times", "At most 250 runs of each stage, the line fitted to all:"),
    )


def _stage(name: str, rows: list[Row]) -> StageTimes:
    line = column(rows[:1], "exponent"), column(rows[:1], "log_factor")
    exponent, log_factor = (float(values[0]) for values in line)
    points, seconds = column(rows, "points"), column(rows, "wall_s")
    return StageTimes(name, points, seconds, int(rows[0]["runs"]), exponent, log_factor)


def _per_million(stage: StageTimes) -> float | None:
    """Return what the line gives for a million points, seconds."""
    if np.isnan(stage.exponent):
        return None
    return round(float(np.exp(stage.log_factor + stage.exponent * np.log(1e6))), 4)


def _place(name: str) -> int:
    return OF_THE_PAPER.index(name) if name in OF_THE_PAPER else len(OF_THE_PAPER)
