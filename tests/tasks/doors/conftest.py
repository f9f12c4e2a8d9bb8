"""Wall images drawn by hand: a flat wall with what tests put on it."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from storage.rooms import Rooms
from storage.wall_images import EMPTY, OCCLUDED, OCCUPIED, WallImages
from storage.walls import Walls

PIXEL_M = 0.04
HEIGHT_M = 2.8


class Face:
    """One face, to draw on: metres along it and up from its foot."""

    def __init__(self, width_m=5.0, height_m=HEIGHT_M, noise_m=0.0, seed=0):
        shape = (round(width_m / PIXEL_M), round(height_m / PIXEL_M))
        self.labels = np.full(shape, OCCUPIED, np.uint8)
        noise = np.random.default_rng(seed).normal(0, 1, shape) * noise_m
        self.depths = noise.astype(np.float32)

    def _at(self, box):
        i0, i1, j0, j1 = (round(m / PIXEL_M) for m in box)
        return slice(i0, i1), slice(j0, j1)

    def moved(self, box, by_m):
        """Set a box back (+) or forth (-)."""
        self.depths[self._at(box)] += np.float32(by_m)
        return self

    def emptied(self, box, depth_m=2.0):
        """Let rays go through a box and see something behind it."""
        self.labels[self._at(box)] = EMPTY
        self.depths[self._at(box)] = depth_m
        return self

    def hidden(self, box):
        """Put something before a box."""
        self.labels[self._at(box)] = OCCLUDED
        self.depths[self._at(box)] = np.nan
        return self


def images_of(faces, walls, rooms, opposite, origins, axes):
    """Return drawn faces as wall images."""
    n = len(faces)
    return WallImages(
        pixel_m=PIXEL_M,
        walls=np.array(walls, np.int32),
        rooms=np.array(rooms, np.int32),
        opposite=np.array(opposite, np.int32),
        origins=np.array(origins, float).reshape(n, 2),
        axes=np.array(axes, float).reshape(n, 2),
        base_m=np.zeros(n),
        labels=tuple(face.labels for face in faces),
        depths=tuple(face.depths for face in faces),
        empty=tuple((face.labels == EMPTY).astype(np.uint8) * 255 for face in faces),
        rays=np.zeros(n, np.int64),
    )


def alone(face):
    """Return one outer face along x, its room above it in the plan."""
    return images_of([face], [0], [0], [-1], [(0, 0)], [(1, 0)])


def two_rooms(north, south, thickness_m=0.12):
    """Return a wall along x with a room on either side; `south` runs from its end to its begin."""
    width = len(north.labels) * PIXEL_M
    half = thickness_m / 2
    images = images_of(
        [north, south],
        [0, 0],
        [0, 1],
        [1, 0],
        [(0, half), (width, -half)],
        [(1, 0), (-1, 0)],
    )
    walls = Walls(
        lines=np.array([[(0, 0), (width, 0)]], float),
        thickness_m=np.array([thickness_m]),
        base_m=np.zeros(1),
        top_m=np.full(1, HEIGHT_M),
        rooms=np.array([(0, 1)], np.int32),
        seen=np.ones(1),
    )
    return images, walls, rooms_of([(0, half, width, 4), (0, -4, width, -half)])


def rooms_of(boxes):
    """Return rectangular rooms."""
    n = len(boxes)
    return Rooms(
        polygons=np.array([shapely.box(*box) for box in boxes], object),
        floor_m=np.zeros(n),
        ceiling_m=np.full(n, HEIGHT_M),
        seen=np.ones(n),
        walled=np.ones(n),
        scans=((0,),) * n,
    )


@pytest.fixture(scope="session")
def scenes():
    """Return what draws wall images."""
    return SimpleNamespace(
        Face=Face,
        alone=alone,
        two_rooms=two_rooms,
        images_of=images_of,
        rooms_of=rooms_of,
        pixel_m=PIXEL_M,
    )
