"""What is compared: grammars, the paper's way against ours, each ingredient, each disturbance."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from correction.storeys import OTHER, SAME

Settings = Mapping[str, Any]
"""Parameters by dotted name, as `--set` takes them."""

NONE, WRONG = "none", "wrong"
"""No grammar: the initial model is the final one; and one of another kind of building."""
HOSPITAL = "hospital"
ORACLE = "oracle"
"""True rooms with true widths, placed like decoded ones: what is left if decoding never errs."""
BOUNDLESS = 1e9
NO_GUARD: Settings = {
    "place.limit": BOUNDLESS,
    "place.most_wrong": 1.0,
    "place.least_gain": -BOUNDLESS,
}
NO_CROWD: Settings = {"decode.crowd.p_outlier": 1e-300}
"""No scan is ever an outlier: what was observed stands."""
PAPER: Settings = {
    "decode.decoder": "plain",
    "decode.transitions": "paper",
    "extract.joints": "ignored",
    "place.widths": "replace",
    **NO_GUARD,
}
"""A hidden Markov model with one rule per observed width, Eq. 9, and the rule's width replaces the
observed one (Fig. 8); nothing that guards the observation."""
SHARES = (0.1, 0.2, 0.3)
"""Of the walls between rooms: missed or imagined."""


@dataclass(frozen=True)
class Variant:
    """One way to correct an initial model."""

    name: str
    about: str
    grammar: str = SAME
    """kind of grammar"""
    settings: Settings = field(default_factory=dict)


MAIN = (
    Variant(NONE, "no grammar: the initial model", NONE),
    Variant(SAME, "grammar of another storey of the building"),
    Variant(OTHER, "grammar of other buildings of the type", OTHER),
    Variant(WRONG, "a hospital's grammar", WRONG),
    Variant("paper", "the paper's way, grammar of the building", SAME, PAPER),
)
INGREDIENTS = (
    Variant("units-split", "rooms of a unit each by itself", SAME, {"decode.units": "split"}),
    Variant("no-unexplained", "every room has a rule", SAME, {"decode.unexplained": "forbidden"}),
    Variant("eq9", "transitions of Eq. 9", SAME, {"decode.transitions": "paper"}),
    Variant("no-smoothing", "relationship as learnt", SAME, {"decode.smoothing": 0.0}),
    Variant("no-depth", "depths ignored", SAME, {"decode.segmental.depth": "ignored"}),
    Variant("plain", "plain Markov model, ours else", SAME, {"decode.decoder": "plain"}),
    Variant("replace", "rule width replaces", SAME, {"place.widths": "replace"}),
    Variant("observed", "observed width stays", SAME, {"place.widths": "observed"}),
    Variant("no-guard", "nothing refused", SAME, NO_GUARD),
    Variant("no-joints", "walls not seen left out", SAME, {"extract.joints": "ignored"}),
    Variant("no-joins", "rooms never joined", SAME, {"place.join_posterior": 1.0}),
    Variant("no-cuts", "rooms never cut in two", SAME, {"place.cut_posterior": 1.0}),
    Variant("all-cuts", "rooms cut wherever decoded", SAME, {"place.cut_posterior": 0.0}),
    Variant("no-crowd", "scans never held against each other after decoding", SAME, NO_CROWD),
    Variant("wrong-no-guard", "a hospital's, nothing refused", WRONG, NO_GUARD),
    Variant("other-eq9", "other buildings', Eq. 9", OTHER, {"decode.transitions": "paper"}),
)
"""The same-building grammar without one ingredient each, but for what is said."""


def disturbances() -> tuple[Variant, ...]:
    """Return all main variants, and ours with all cuts, with walls missed and imagined."""
    bases = [*MAIN, *(v for v in INGREDIENTS if v.name == "all-cuts")]
    return tuple(
        Variant(
            f"{base.name}-{what}{share:.0%}".rstrip("%"),
            f"{base.about}; {share:.0%} {what}",
            base.grammar,
            {**base.settings, f"disturb.{what}": share},
        )
        for what in ("missing", "spurious")
        for share in SHARES
        for base in bases
    )


def nested(settings: Settings) -> dict[str, Any]:
    """Return settings by stage, as parameters are made of them."""
    whole: dict[str, Any] = {}
    for name, value in settings.items():
        *parents, last = name.split(".")
        at = whole
        for parent in parents:
            at = at.setdefault(parent, {})
        at[last] = value
    return whole
