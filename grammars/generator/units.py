"""Room units: sequences of rooms that come together, found by minimum description length.

A description of all rows of rooms has two parts, in bits. With K types of rooms and N rules applied
in all, n_r times rule r:

- the rules: half a log2 N for the probability of each rule that is used, and for a unit of k rooms
  k log2 K + log2 (k_max - 1) for what it consists of;
- the rows: -log2 (n_r / N) for each rule applied, rows being cut into rules as is shortest.

A sequence becomes a unit if that makes the description shorter. Of the sequences of rules that
occur twice or more the best is taken first, then the best of the sequences that are left, until
none makes it shorter; a unit that later ones made superfluous goes again. Where rows are read in
both directions a unit and its mirror image come together, described once, and every reading counts
for a half.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Row = tuple[int, ...]
"""Types of the rooms of a run of neighbours, or of a rule."""

TRIED = 12
"""Sequences tried in full each round, the most promising by an estimate of what they save."""
ROUNDS = 20
"""Rounds of cutting and counting until the description gets no shorter; far more than needed."""


@dataclass(frozen=True)
class Reading:
    """Rows cut into rules."""

    rules: tuple[Row, ...]
    """the rules that are used, single rooms first"""
    rows: tuple[tuple[int, ...], ...]
    """per row read, its rules in their order"""
    bits: float
    """length of the description"""


def readings(rows: Sequence[Row], both: bool) -> tuple[list[Row], float]:
    """Return rows as they are read, and what each reading counts for."""
    if not both:
        return list(rows), 1.0
    return [r for row in rows for r in (row, row[::-1])], 0.5


def find_units(rows: Sequence[Row], n_types: int, parts_max: int, both: bool) -> Reading:
    """Return the rules that describe rows shortest, and the rows cut into them.

    Parameters
    ----------
    rows : types of the rooms, 0 <= type < n_types, by runs of neighbours
    parts_max : most rooms of a unit
    both : whether rows are read in both directions; then they come twice in the result, a row and
        after it its mirror image
    """
    read, weight = readings(rows, both)
    coder = _Coder(read, weight, n_types, parts_max, both)
    units: tuple[Row, ...] = ()
    best = coder.encode(units)
    while True:
        trials = [(*units, *pair) for pair in _promising(best, weight, coder, both)]
        trials += [tuple(u for u in units if u not in (v, v[::-1])) for v in units]
        results = [coder.encode(trial) for trial in trials]
        shortest = min(results, key=lambda r: r.bits, default=best)
        if shortest.bits >= best.bits - 1e-6:
            return best
        best = shortest
        units = tuple(rule for rule in best.rules if len(rule) > 1)


def _promising(now: Reading, weight: float, coder: "_Coder", both: bool) -> list[tuple[Row, ...]]:
    """Return sequences of rules that may shorten the description, each with its mirror image.

    What a unit would save if nothing else were cut otherwise: the bits of its rules less its own,
    each time it is applied, less the bits that describe it.
    """
    applied = np.bincount([rule for row in now.rows for rule in row], minlength=len(now.rules))
    total = int(applied.sum())
    bits = -np.log2(applied / total)
    counts: Counter[Row] = Counter()
    apart: dict[Row, float] = {}
    for row in now.rows:
        for size in range(2, coder.parts_max + 1):
            for rules in _disjoint(row, size):
                sequence = tuple(type_ for rule in rules for type_ in now.rules[rule])
                if len(sequence) <= coder.parts_max:
                    counts[sequence] += 1
                    cost = float(bits[list(rules)].sum())
                    apart[sequence] = min(cost, apart.get(sequence, cost))
    found: dict[tuple[Row, ...], float] = {}
    for sequence, count in counts.items():
        pair = _with_mirror(sequence, both)
        if sequence == pair[0] and count * weight >= 2 and sequence not in now.rules:
            saved = sum(counts[s] for s in pair) * (apart[sequence] + np.log2(count / total))
            found[pair] = float(weight * saved) - coder.unit_bits(sequence)
    ranked = sorted(found, key=lambda pair: (-found[pair], pair))
    return [pair for pair in ranked[:TRIED] if found[pair] > 0]


def _with_mirror(sequence: Row, both: bool) -> tuple[Row, ...]:
    mirrored = sequence[::-1]
    if not both or mirrored == sequence:
        return (sequence,)
    return (sequence, mirrored) if sequence < mirrored else (mirrored, sequence)


def _disjoint(row: Row, size: int) -> list[Row]:
    """Return the sequences of a row, each as often as it fits in without overlap."""
    found: list[Row] = []
    free: dict[Row, int] = {}
    for i in range(len(row) - size + 1):
        sequence = row[i : i + size]
        if free.get(sequence, 0) <= i:
            found.append(sequence)
            free[sequence] = i + size
    return found


class _Coder:
    """Cuts rows into rules as is shortest, and counts the bits."""

    def __init__(
        self, rows: Sequence[Row], weight: float, n_types: int, parts_max: int, both: bool
    ) -> None:
        self.rows, self.order = Counter(rows), rows
        self.weight, self.n_types, self.parts_max, self.both = weight, n_types, parts_max, both

    def unit_bits(self, unit: Row) -> float:
        """Return the bits that say what a unit consists of."""
        return len(unit) * float(np.log2(max(self.n_types, 2))) + float(np.log2(self.parts_max - 1))

    def encode(self, units: Sequence[Row]) -> Reading:
        """Return rows cut into single rooms and the given units, those alone that are used."""
        costs = self._first_costs(units)
        best: Reading | None = None
        for _ in range(ROUNDS):
            cuts = {row: cut(row, costs) for row in self.rows}
            counts: Counter[Row] = Counter()
            for row, number in self.rows.items():
                for rule in cuts[row]:
                    counts[rule] += number
            reading = self._reading(cuts, counts)
            if best is not None and reading.bits >= best.bits - 1e-9:
                break
            best = reading
            total = sum(counts.values())
            unused = float(np.log2(total)) + 1
            costs = dict.fromkeys(costs, unused)
            costs |= {rule: -float(np.log2(n / total)) for rule, n in counts.items()}
        assert best is not None
        return best

    def _first_costs(self, units: Sequence[Row]) -> dict[Row, float]:
        counts: Counter[Row] = Counter()
        for row, number in self.rows.items():
            for type_ in row:
                counts[(type_,)] += number
            for unit in units:
                counts[unit] += number * _disjoint(row, len(unit)).count(unit)
        total = sum(counts.values())
        return {rule: -float(np.log2(n / total)) for rule, n in counts.items() if n}

    def _reading(self, cuts: Mapping[Row, list[Row]], counts: Mapping[Row, int]) -> Reading:
        total = sum(counts.values())
        rules = tuple(sorted((r for r, n in counts.items() if n), key=lambda r: (len(r) > 1, r)))
        bits = sum(-self.weight * counts[r] * float(np.log2(counts[r] / total)) for r in rules)
        bits += len(rules) * float(np.log2(max(total * self.weight, 2))) / 2
        described = {min(rule, rule[::-1]) for rule in rules} if self.both else set(rules)
        bits += sum(self.unit_bits(rule) for rule in described if len(rule) > 1)
        index = {rule: i for i, rule in enumerate(rules)}
        rows = tuple(tuple(index[rule] for rule in cuts[row]) for row in self.order)
        return Reading(rules, rows, bits)


def cut(row: Row, costs: Mapping[Row, float]) -> list[Row]:
    """Return the rules, of those with a cost, that make up a row at the least cost.

    Of equal cuttings, the one that starts with longer rules is taken. Single rooms without a cost
    cost more than anything else.
    """
    longest = max((len(rule) for rule in costs), default=1)
    dear = 1 + sum(max(costs.values(), default=0.0) for _ in row)
    best: list[tuple[float, list[Row]]] = [(0.0, [])]  # from the row's end
    for start in range(len(row) - 1, -1, -1):
        options = []
        for size in range(min(longest, len(row) - start), 0, -1):
            rule = row[start : start + size]
            if rule in costs or size == 1:
                cost, rest = best[len(row) - start - size]
                options.append((cost + costs.get(rule, dear), [rule, *rest]))
        best.append(min(options, key=lambda option: round(option[0], 9)))
    return best[-1][1]
