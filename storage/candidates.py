"""What may be a door or a window: rectangles on wall faces, with what tells them apart (Sec. 5)."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from storage.artifacts import Kind, column, register, schema

_FIG_10 = {
    "width_m": "width of the rectangle",
    "height_m": "height of the rectangle",
    "wall_width_m": "width of the wall face",
    "wall_height_m": "height of the wall face",
    "left_m": "from the face's begin to the rectangle",
    "right_m": "from the rectangle to the face's end",
    "below_m": "from the face's foot to the rectangle",
    "above_m": "from the rectangle to the face's top",
}
_SHARES = {
    "occupied_share": "share of the pixels where the wall was hit",
    "empty_share": "share of the pixels rays went through",
    "occluded_share": "share of the pixels where all rays were stopped before the wall",
}
_OF_A_FACE = {
    "back_share": "share of the pixels seen whose surface lies behind the wall",
    "through_share": "share of the pixels through which something was seen",
    "recess_m": "median of what was hit, behind the wall around it",
    "spread_m": "half the spread of what was hit, 10th to 90th percentile",
    "slant": "rise of what was hit along the width, metres per metre, its size",
    "left_edge": "share of the left side along which there is an edge",
    "right_edge": "share of the right side along which there is an edge",
    "head_edge": "share of the upper side along which there is an edge",
    "left_back_share": "back_share of a strip left of the rectangle",
    "right_back_share": "back_share of a strip right of it",
    "over_back_share": "back_share of a strip over it",
    "under_back_share": "back_share of a strip under it",
    "frame_m": "how far what was hit around the rectangle stands out of the wall beyond",
    "left_step_m": "mean depth within, behind that of the strip left of the rectangle",
    "right_step_m": "mean depth within, behind that of the strip right of it",
    "over_step_m": "mean depth within, behind that of the strip over it",
    "foot_step_m": "mean depth of the lowest metre within, behind that of both strips beside",
    "left_rim_m": "mean depth just within the left side, behind that beyond the frame there",
    "right_rim_m": "mean depth just within the right side, behind that beyond the frame there",
    "head_rim_m": "mean depth just below the upper side, behind that over the frame",
    "wall_back_share": "back_share of the whole face",
    "noise_m": "median deviation of what was hit on the face from its wall",
}
_THERE = (
    "occupied_share",
    "empty_share",
    "occluded_share",
    *(name for name in _OF_A_FACE if name not in ("wall_back_share", "noise_m")),
)
_BOTH = {
    "thickness_m": "distance of the wall's two faces as the images lie",
    "other_room": "1 if a room looks at the wall's other face",
}
ABOUT = {
    **_FIG_10,
    **_SHARES,
    **_OF_A_FACE,
    **{f"opposite_{name}": f"{name} at the same place of the other face" for name in _THERE},
    **_BOTH,
}
"""What each feature says: Fig. 10's eight of size and position, the three shares of areas, and
ours: what lies behind the wall, its edges, what is around it, and the wall's other face."""
FEATURES = tuple(ABOUT)
"""The features, in the order of a candidate's columns."""
FIG_10 = tuple(_FIG_10)
"""The eight features of size and position (Fig. 10)."""
SHARES = tuple(_SHARES)
"""The three shares of areas (Sec. 5)."""
OF_A_FACE = tuple(_OF_A_FACE)
"""What else is measured on the face itself."""
THERE = _THERE
"""What is measured at the same place of the other face, NaN where there is none."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """n rectangles; entry i is one candidate everywhere. Metres."""

    faces: NDArray[np.int32]
    """(n,), row of WallImages"""
    from_m: NDArray[np.float64]
    """(n,), begin along the face's axis, from its origin"""
    to_m: NDArray[np.float64]
    """(n,), end along the face's axis"""
    sill_m: NDArray[np.float64]
    """(n,), height of the lower side, building frame"""
    head_m: NDArray[np.float64]
    """(n,), height of the upper side, building frame"""
    features: NDArray[np.float64]
    """(n, k), in the order of FEATURES; NaN unknown"""

    def __len__(self) -> int:
        return len(self.faces)

    def feature(self, name: str) -> NDArray[np.float64]:
        """Return one feature of all candidates, (n,)."""
        return self.features[:, FEATURES.index(name)]

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "Candidates":
        """Return some of the candidates."""
        return Candidates(
            self.faces[rows],
            self.from_m[rows],
            self.to_m[rows],
            self.sill_m[rows],
            self.head_m[rows],
            self.features[rows],
        )


_PLACE = {
    "from_m": "begin along the face's axis",
    "to_m": "end along the face's axis",
    "sill_m": "height of the lower side, building frame",
    "head_m": "height of the upper side, building frame",
}
SCHEMA = schema(
    "opening_candidates",
    [
        column("face", pa.int32(), "row of the wall face"),
        *(column(name, pa.float64(), about) for name, about in _PLACE.items()),
        *(column(name, pa.float64(), about, nullable=True) for name, about in ABOUT.items()),
    ],
)


def to_table(candidates: Candidates) -> pa.Table:
    """Return one row per candidate."""
    return pa.table(
        [
            pa.array(candidates.faces, pa.int32()),
            *(pa.array(getattr(candidates, name)) for name in _PLACE),
            *(
                pa.array(candidates.features[:, i], pa.float64(), from_pandas=True)
                for i in range(len(FEATURES))
            ),
        ],
        schema=SCHEMA,
    )


def from_table(table: pa.Table) -> Candidates:
    """Return the candidates a table holds."""
    features = [table[name].to_numpy().astype(float) for name in FEATURES]
    return Candidates(
        faces=table["face"].to_numpy(),
        features=np.column_stack(features),
        **{name: table[name].to_numpy() for name in _PLACE},
    )


CANDIDATES = register(Kind("opening_candidates", Candidates, SCHEMA, to_table, from_table))
