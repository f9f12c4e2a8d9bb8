"""Colours and layers of the drawing."""

INK, MUTED, POCHE = "#2b2b2e", "#8a8a90", "#46464b"
"""Lines and text, secondary lines and text, cut walls."""
AREA_INK = "#66666c"
"""A room's area under its name."""
NEUTRAL = "#f1efe9"
"""Rooms without a class."""
TINTS = ("#e3ecf4", "#f6ead7", "#e6f0e2", "#f4e3e1", "#ece5f3", "#e0f0ef", "#f4f0d4", "#ece4dc")
"""Rooms by class, in the alphabetical order of the classes."""
CORRIDOR = "#f3f3f1"
"""The way through is the quietest."""
SEEN_ONCE = "#f0f0ef"
"""Floor that one scan saw, where no room is drawn."""
SEEN = ((2, 0.04), (3, 0.05))
"""(least number of scans, how much darker a room is drawn there)"""
ASSUMED = "#cdcdd2"
"""Walls whose thickness is not known."""
UNSEEN = "#a9a9b0"
"""Hatch of floor that no scan saw."""
LAYERS = {
    "rooms": 1.0,
    "coverage": 2.0,
    "furniture": 3.0,
    "outlines": 3.5,
    "walls": 4.0,
    "openings": 5.0,
    "labels": 6.0,
}
"""What is drawn over what."""


def room_tints(classes: set[str | None]) -> dict[str | None, str]:
    """Return a soft colour per room class."""
    named = sorted(class_ for class_ in classes if class_ is not None and class_ != "corridor")
    tints: dict[str | None, str] = {None: NEUTRAL, "corridor": CORRIDOR}
    return tints | {class_: TINTS[i % len(TINTS)] for i, class_ in enumerate(named)}
