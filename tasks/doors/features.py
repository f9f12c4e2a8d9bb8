"""What tells doors and windows from the rest: Fig. 10's features, area shares, and ours."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat

from storage.candidates import FEATURES, FIG_10
from storage.wall_images import WallImages
from tasks.doors.measuring import MEASURED, measure
from tasks.params import Params


class FeatureParams(Params):
    """Where in and around a rectangle is looked."""

    strip_m: PositiveFloat = 0.25
    """Width of the strips around a rectangle, metres: the least wall between a door and a corner.
    Assumption."""
    frame_m: PositiveFloat = 0.08
    """Width of the strip a frame lies in, metres: what a steel frame covers of the wall (DIN
    18111) and a pixel's error. Assumption."""
    edge_m: PositiveFloat = 0.06
    """How far from a side its edge may lie, metres. Assumption."""


@dataclass(frozen=True, eq=False)
class FaceView:
    """All that is looked at of one face."""

    labels: NDArray[np.uint8]
    """(a, b), as in `WallImages`"""
    depth: NDArray[np.float32]
    """(a, b), metres behind the wall around; NaN not seen"""
    upright: NDArray[np.uint8]
    """(a, b), upright edges"""
    level: NDArray[np.uint8]
    """(a, b), level edges"""
    noise_m: float
    """median deviation of what was hit from the wall"""
    back_m: float
    """what lies further back than this lies behind the wall"""
    pixel_m: float

    def measured(
        self, rectangles: NDArray[np.float64], params: FeatureParams
    ) -> NDArray[np.float64]:
        """Return what the face shows in each rectangle, in the order of `MEASURED`."""
        pixels = rectangles / self.pixel_m
        return measure(
            self.labels,
            self.depth,
            self.upright,
            self.level,
            np.rint(pixels).astype(np.int64),
            *(max(round(m / self.pixel_m), 1) for m in self._strips(params)),
            self.back_m,
            self.pixel_m,
        )

    def back_share(self) -> float:
        """Return the share of what was seen on the face that lies behind the wall."""
        seen = ~np.isnan(self.depth)
        return float((self.depth[seen] > self.back_m).mean()) if seen.any() else np.nan

    def size_m(self) -> tuple[float, float]:
        """Return the face's width and height."""
        return self.labels.shape[0] * self.pixel_m, self.labels.shape[1] * self.pixel_m

    def _strips(self, params: FeatureParams) -> tuple[float, float, float]:
        return params.strip_m, params.frame_m, params.edge_m


def features_of(
    images: WallImages,
    views: list[FaceView],
    face: int,
    rectangles: NDArray[np.float64],
    params: FeatureParams,
) -> NDArray[np.float64]:
    """Return the features of rectangles on one face, in the order of `FEATURES`.

    Parameters
    ----------
    views : one per face of `images`
    rectangles : (n, 4) float
        Begin and end along the face, lower and upper side over its foot, metres.
    """
    view, other = views[face], int(images.opposite[face])
    columns = dict(zip(FIG_10, _sizes(rectangles, *view.size_m()).T, strict=True))
    columns |= dict(zip(MEASURED, view.measured(rectangles, params).T, strict=True))
    n = len(rectangles)
    columns["wall_back_share"] = np.full(n, view.back_share())
    columns["noise_m"] = np.full(n, view.noise_m)
    columns["other_room"] = np.full(n, float(other >= 0))
    if other >= 0:
        there = views[other].measured(on_opposite(images, face, rectangles), params)
        columns |= {f"opposite_{k}": c for k, c in zip(MEASURED, there.T, strict=True)}
        columns["thickness_m"] = np.full(n, apart_m(images, face))
    unknown = np.full(n, np.nan)
    return np.column_stack([columns.get(name, unknown) for name in FEATURES])


def on_opposite(
    images: WallImages, face: int, rectangles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return rectangles on one face as they lie on the face on the wall's other side."""
    other = int(images.opposite[face])
    shift = images.origins[face] - images.origins[other]
    axis, there = images.axes[face], images.axes[other]
    along = float(shift @ there) + rectangles[:, :2] * float(axis @ there)
    up = rectangles[:, 2:] + (images.base_m[face] - images.base_m[other])
    return np.column_stack([along.min(axis=1), along.max(axis=1), up])


def apart_m(images: WallImages, face: int) -> float:
    """Return the distance of the two faces of a wall, metres."""
    other = int(images.opposite[face])
    return float(abs((images.origins[face] - images.origins[other]) @ images.normals()[face]))


def _sizes(rectangles: NDArray[np.float64], width: float, height: float) -> NDArray[np.float64]:
    """Return Fig. 10's eight in their order."""
    begin, end, low, high = rectangles.T
    n = len(rectangles)
    return np.column_stack(
        [
            end - begin,
            high - low,
            np.full(n, width),
            np.full(n, height),
            begin,
            width - end,
            low,
            height - high,
        ]
    )
