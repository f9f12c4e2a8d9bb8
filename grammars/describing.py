"""A grammar as a text for the terminal."""

from grammars.model import Grammar, Rule

BAR = 24
"""Characters of the widest rule's bar."""
FOLLOWERS = 3
"""Likeliest followers shown of each rule."""


def describe(grammar: Grammar) -> str:
    """Return what a person wants to know of a grammar: rules with widths to scale, followers."""
    data = "simulated data" if grammar.simulated else "no simulated data"
    lines = [f"{grammar.name}: {grammar.building_type} ({data})", *grammar.about.splitlines(), ""]
    lines += _origins(grammar)
    lines += _walls(grammar)
    ids = max(len("rule"), *(len(rule.id) for rule in grammar.rules))
    lines += ["", f"  {'P_a':>5}  {'rule':<{ids}}  {'width':>8}"]
    widest = max(rule.width_m for rule in grammar.rules)
    for rule in _by_probability(grammar):
        lines.append(
            f"  {rule.p_apriori:5.3f}  {rule.id:<{ids}}  {rule.width_m:6.2f} m  "
            f"{_bar(rule, widest):<{BAR + 6}}{_production(rule)}"
        )
    lines += ["", f"what follows a rule, the {FOLLOWERS} likeliest:"]
    for i, rule in enumerate(grammar.rules):
        row = grammar.p_relation[i]
        order = sorted(range(len(row)), key=lambda j: (-row[j], j))
        shown = (f"{grammar.rules[j].id} {row[j]:.2f}" for j in order[:FOLLOWERS] if row[j] > 0)
        lines.append(f"  {rule.id:<{ids}}  {', '.join(shown)}")
    return "\n".join(lines) + "\n"


def _origins(grammar: Grammar) -> list[str]:
    if not grammar.learnt_from:
        return ["learnt from no plan: written by hand"]
    storeys: dict[str, list[str]] = {}
    for origin in grammar.learnt_from:
        storeys.setdefault(origin.building, []).append(origin.storey)
    shown = [f"{building} ({', '.join(found)})" for building, found in storeys.items()]
    more = f", and {len(shown) - 6} more buildings" if len(shown) > 6 else ""
    return [
        f"learnt from {len(grammar.learnt_from)} storeys: {', '.join(shown[:6])}{more}",
        f"evidence: {grammar.evidence:g} applications of rules",
    ]


def _walls(grammar: Grammar) -> list[str]:
    found = [f"partitions: {grammar.partition_m:.3f} ± {grammar.partition_spread_m:.3f} m"]
    for what, wall in (("corridor", grammar.corridor_wall), ("outer", grammar.outer_wall)):
        if wall is not None:
            found.append(f"{what} walls: {wall.thickness_m:.3f} ± {wall.spread_m:.3f} m")
    if grammar.module is not None:
        module = grammar.module
        found.append(f"facade module: {module.width_m:.3f} ± {module.spread_m:.3f} m")
    if grammar.lines:
        storeys = sorted({line.storey for line in grammar.lines})
        found.append(f"reference lines: {len(grammar.lines)}, storey {', '.join(storeys)}")
    return found


def _by_probability(grammar: Grammar) -> list[Rule]:
    return sorted(grammar.rules, key=lambda rule: -rule.p_apriori)


def _bar(rule: Rule, widest_m: float) -> str:
    """Return a rule's rooms in a row, to scale: at least one character each."""
    ends, at = [], 0.0
    for part in rule.parts:
        at += part.width_m
        ends.append(round(at / widest_m * BAR))
    starts = [0, *ends[:-1]]
    rooms = ("─" * max(1, end - start) for start, end in zip(starts, ends, strict=True))
    return f"├{'┼'.join(rooms)}┤"


def _production(rule: Rule) -> str:
    parts = " ".join(f"{p.class_} {p.width_m:.2f}±{p.spread_m:.2f}" for p in rule.parts)
    return f"Space → {parts} Space"
