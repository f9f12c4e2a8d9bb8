"""The hidden Markov model against hmmlearn, and what a longer line costs the segmental decoder."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from harness import BenchmarkError, Case, Prepared, measure
from hmmlearn.hmm import GaussianHMM
from numpy.typing import NDArray
from report import Column, Report, Table, Target

from grammars.model import Grammar, Part, Rule
from storage.observations import Observations
from tasks.layout.decoding.decode import DecodeParams, decode
from tasks.layout.decoding.hmm import Model
from tasks.layout.decoding.hmm import viterbi as decode_lines

OURS, HMMLEARN = "ours", "hmmlearn"
SIZES = ((12, 20, 40), (50, 30, 200), (200, 100, 1000))
"""Rules, observations of a line, lines; the first is a real storey."""
LONGER = (25, 50, 100, 200)
"""Walls of a line."""
ROUNDS = 3
COLUMNS = (
    Column("case", "decoder"), Column("seconds", "seconds", "{:.4f}"),
    Column("cpu_seconds", "cpu s", "{:.4f}"), Column("ratio", "ours / theirs", "{:.3f}"),
    Column("microseconds", "us a line", "{:.1f}"), Column("runs", "runs"),
)  # fmt: skip
LONGER_COLUMNS = (
    Column("case", "walls a line"), Column("seconds", "seconds", "{:.3f}"),
    Column("cpu_seconds", "cpu s", "{:.3f}"), Column("milliseconds", "ms a line", "{:.1f}"),
    Column("per_wall", "cpu us a wall", "{:.0f}"), Column("runs", "runs"),
)  # fmt: skip
NOTES = [
    "Both decoders must return the same sequences. hmmlearn decodes line by line, as it must.",
    "The segmental decoder: 15 rules, a tenth of the walls missed and as many imagined, with the",
    "three best sequences and all posteriors.",
]


def viterbi(quick: bool) -> Report:
    """Measure times; quick runs each once and leaves out the largest case."""
    report = Report("Viterbi: rules along reference lines", notes=list(NOTES))
    for size in SIZES[: 2 if quick else None]:
        rules, observations, lines = size
        measured = measure(
            Case(OURS, partial(prepare, OURS, size)),
            [Case(HMMLEARN, partial(prepare, HMMLEARN, size), rival=True)],
            1 if quick else ROUNDS,
        )
        if len({m.figures["sums"] for m in measured.values()}) > 1:
            raise BenchmarkError(f"{size}: the decoders returned different sequences")
        ratio = measured[OURS].ratio(measured[HMMLEARN])
        rows = [m.row() | {"microseconds": 1e6 * m.median_s / lines} for m in measured.values()]
        rows[1]["ratio"] = ratio
        title = f"{rules} rules, {lines:,} lines of {observations} observations"
        report.tables.append(Table(title, COLUMNS, rows))
        if size == SIZES[-1]:
            report.targets += [
                Target(f"{title}: time", measured[OURS].median_s, 0.5, " s", of_time=True),
                Target(f"{title}: time / hmmlearn", ratio, 0.1, "x", of_time=True),
            ]
    rows = _longer(1 if quick else ROUNDS)
    report.tables.append(Table("segmental decoder, 20 lines", LONGER_COLUMNS, rows))
    growth = rows[-1]["per_wall"] / rows[0]["per_wall"]
    what = f"segmental: a wall of {LONGER[-1]} / one of {LONGER[0]}, cpu"
    report.targets.append(Target(what, growth, 1.5, "x", of_time=True))
    return report


def _longer(rounds: int) -> list[dict[str, Any]]:
    rows = []
    for walls in LONGER:
        ours = measure(Case(str(walls), partial(prepare_segmental, walls)), rounds=rounds)
        row = ours[str(walls)].row()
        row["milliseconds"] = 1e3 * row["seconds"] / 20
        row["per_wall"] = 1e6 * row["cpu_seconds"] / (20 * walls)
        rows.append(row)
    return rows


def prepare(name: str, size: tuple[int, int, int]) -> Prepared:
    """Return a decoder that is warm, and its lines."""
    rules, observations, lines = size
    rng = np.random.default_rng(1)
    p_a, p_r = rng.dirichlet(np.ones(rules)), rng.dirichlet(np.ones(rules), rules)
    widths, observed = rng.uniform(2, 20, rules), rng.uniform(2, 20, (lines, observations))
    if name == OURS:
        model = Model(np.log(p_a), np.log(p_r), widths, 1.0)
        counts = np.full(lines, observations)
        decode_lines(model, observed[:2], counts[:2])
        return Prepared(lambda: decode_lines(model, observed, counts)[0], judge)
    theirs = GaussianHMM(rules, "diag", init_params="")
    theirs.startprob_, theirs.transmat_ = p_a, p_r
    theirs.means_, theirs.covars_ = widths[:, None], np.ones((rules, 1))
    theirs.decode(observed[0][:, None])
    return Prepared(lambda: [theirs.decode(line[:, None])[1] for line in observed], judge)


def judge(paths: Sequence[NDArray[np.int64]]) -> dict[str, Any]:
    """Return sums that differ where sequences do."""
    found = np.stack(paths).astype(np.int64)
    return {"sums": int((found * (1 + np.arange(found.size).reshape(found.shape) % 997)).sum())}


def prepare_segmental(walls: int) -> Prepared:
    """Return the decoder, warm, and 20 lines of about as many walls."""
    grammar, observations = office(), lines_of(walls)
    decode(lines_of(3), grammar, DecodeParams())
    return Prepared(lambda: decode(observations, grammar, DecodeParams()))


def office() -> Grammar:
    """Return 15 rules, three of them units."""
    rng = np.random.default_rng(2)
    p_a = rng.dirichlet(np.full(15, 5.0))
    rules = tuple(
        Rule(
            f"r{i}",
            tuple(Part(f"c{k}", rng.uniform(2, 7), 0.2, rng.uniform(3, 6), 0.2) for k in range(m)),
            float(p),
        )
        for i, (p, m) in enumerate(zip(p_a, [1] * 12 + [2, 3, 3], strict=True))
    )
    p_r = np.array([rng.dirichlet(30 * p_a + 0.1) for _ in rules])
    return Grammar(
        "bench", "office", "", (), True, ("c0", "c1", "c2"), rules, p_r, 0.1, 0.01
    )  # fmt: skip


def lines_of(walls: int) -> Observations:
    """Return 20 lines of as many walls, a tenth of them imagined and as many left out."""
    rng, grammar = np.random.default_rng(3), office()
    bounds, cuts = [], []
    for _ in range(20):
        widths: list[float] = []
        rule = int(rng.choice(15, p=grammar.p_apriori))
        while len(widths) <= walls:
            widths += [rng.normal(p.width_m, p.spread_m) for p in grammar.rules[rule].parts]
            rule = int(rng.choice(15, p=grammar.p_relation[rule]))
        at = np.cumsum(widths[: walls + 1])
        seen = at[:-1][rng.random(walls) >= 0.1]
        imagined = rng.uniform(0.3, at[-1] - 0.3, walls - len(seen))
        cuts.append(np.sort(np.concatenate([seen + rng.normal(0, 0.05, len(seen)), imagined])))
        bounds.append(np.concatenate([[0.0], cuts[-1], at[-1:]]))
    n, each = 20 * walls, np.arange(20)
    return Observations(
        line_ids=np.array([f"rls{i}" for i in each]),
        starts=np.zeros((20, 2)),
        ends=np.column_stack([[b[-1] for b in bounds], np.zeros(20)]),
        end_sigma_m=np.full((20, 2), np.nan),
        end_faces_m=np.full((20, 2, 2), np.nan),
        lines=np.repeat(each, walls),
        cut_m=np.concatenate(cuts),
        sigma_m=np.full(n, 0.05),
        faces_m=np.full((n, 2), np.nan),
        scans=np.ones(n, np.int64),
        presence=np.full(n, 0.7),
        interval_lines=np.repeat(each, walls + 1),
        from_m=np.concatenate([b[:-1] for b in bounds]),
        to_m=np.concatenate([b[1:] for b in bounds]),
        rooms=np.full(n + 20, -1),
        depth_m=rng.uniform(3, 6, n + 20),
    )
