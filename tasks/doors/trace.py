"""Label and depth images of all walls of a storey, by ray tracing (Sec. 5, Fig. 9)."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat, PositiveInt

from storage.layout_rooms import LayoutRooms
from storage.layout_walls import LayoutWalls
from storage.points import PointCloud
from storage.rooms import Rooms
from storage.snapshots import Snapshots
from storage.wall_images import WallImages
from storage.walls import Walls
from tasks.doors.faces import WallFaces, wall_faces
from tasks.doors.labelling import labelled, scanned, without_holes
from tasks.doors.rays import Canvas, Eyes, Limits, Votes, cast_rays, uncast
from tasks.doors.relief import LAYER_M, layered, relief, standing
from tasks.doors.spacing import FINEST_M, spacing_m
from tasks.doors.viewpoints import ViewParams, chosen, interior_eyes, of_room, snapshot_eyes
from tasks.doors.voxels import DistanceField, distance_field
from tasks.params import Params
from tasks.threads import spread

AIR_M = 1.0
"""Space kept around the rooms, metres: what is seen through windows and outer doors."""


class TraceParams(Params):
    """Ray tracing of the wall faces."""

    pixel_m: PositiveFloat = 0.04
    """Edge of a pixel, metres. The paper names none; 4 cm are a twentieth of a narrow door."""
    voxel_m: PositiveFloat = 0.05
    """Edge of a voxel, metres: fine enough for a leaf, coarse enough to be full where a surface
    was scanned. Not in the paper."""
    per_spacing: PositiveFloat = 1.0
    """Pixels and voxels are no smaller than this times the distance of neighbouring points: at a
    point every 10 cm, walls of finer voxels are full of holes. Not in the paper."""
    coarsest_m: PositiveFloat = 0.2
    """Edge of pixels from which nothing is said of any: a narrow door is three of them wide.
    Assumption."""
    least_points: PositiveInt = Field(default=1, le=255)
    """Points from which a voxel stops rays. One, as the device keeps a point of each small voxel
    only and walls seen once from afar have no more; of a raw scan two, as one may be noise. Not in
    the paper."""
    d: PositiveFloat = 0.1
    """Distance to the face within which a ray has hit it, metres (Sec. 5 names no number)."""
    d_0: PositiveFloat = 0.1
    """Safety margin added to `d`, or to the wall's thickness if that is more: a ray that ends
    further behind the face went through (Sec. 5 names no number)."""
    aside_m: PositiveFloat = 0.05
    """A ray that ends within the wall, further than this behind its face and beside its pixel, did
    not end at it, metres: it came in by an opening and met the reveal, or a leaf elsewhere. A
    voxel's edge. Not in the paper."""
    over_m: PositiveFloat = 2.1
    """Higher than this over its foot a wall is closed, metres: heads of doors lie at 2 m. In a room
    without snapshots, rays that go through there as well tell of a wall that was not scanned.
    Assumption."""
    least_wall: float = Field(default=0.7, ge=0, le=1)
    """Share of the pixels reached up there that were hit, on the one of a wall's faces that has
    more; below it what is empty as seen from assumed places is NOT_SEEN. Not in the paper."""
    behind_m: PositiveFloat = 3.0
    """How far behind the face a ray is followed, metres. Assumption."""
    least_incidence: float = Field(default=0.4, ge=0, lt=1)
    """Least cosine of the angle between a ray and the face's normal: at sharper angles a wall's
    own noise stands before it. Not in the paper."""
    least_grazing: float = Field(default=0.12, ge=0, lt=1)
    """The same where fewer than `enough_grazing` rays have reached the pixel: corridors are scanned
    lengthwise. Not in the paper."""
    enough_grazing: PositiveInt = 4
    """Rays that reach a pixel, after which none are cast at sharper angles. Not in the paper."""
    enough_rays: PositiveInt = 12
    """Rays that reach a pixel, after which no more are cast at it. Not in the paper."""
    empty_share: float = Field(default=0.5, gt=0, le=1)
    """Share of the rays that reach a pixel that must go through it to make it empty. Not in the
    paper."""
    relief_m: PositiveFloat = 0.3
    """How far behind the face points count for its depth image, metres, but no further than where
    those of the wall's other face begin; before it they count to `d`. Assumption."""
    other_face_m: PositiveFloat = 0.04
    """Distance from the wall's other face at which its points begin, metres: noise and drift."""
    astray_m: PositiveFloat = 0.2
    """How far from its place in the plan a face may stand, metres; behind it no further than half
    its wall. Labels and depths are those of the face where it stands. Assumption."""
    view: ViewParams = ViewParams()
    """Where rays start from."""


def trace_walls(
    rooms: Rooms,
    walls: Walls,
    points: list[PointCloud],
    snapshots: list[Snapshots],
    params: TraceParams,
) -> WallImages:
    """Return what is seen of every wall face from the room before it.

    Parameters
    ----------
    rooms : Rooms
    walls : Walls
        Their `rooms` are rows of `rooms`.
    points, snapshots : list
        Of the storey's scans, building frame.

    Returns
    -------
    WallImages
        One face for each room a wall piece has. Rays start from the snapshots that were taken in
        the room and saw the pixel; in a room without any, from all over its inside, and a ray that
        meets nothing at all then says nothing.

    Raises
    ------
    MapSenseError
        If the storey is too large for its voxels.

    Notes
    -----
    Where points lie so far apart that pixels of their spacing would be coarser than `coarsest_m`,
    no ray is cast: all pixels are NOT_SEEN.

    Sec. 5, Fig. 9. A wall stands between its base and top; where one of them is not known, those
    of the storey's other walls stand in; where none are, the lowest and highest points.
    """
    faces = wall_faces(rooms, walls)
    base, top = _heights(walls, points)
    params = as_coarse(params, _spacing(walls, base, top, points))
    eyes, assumed = _eyes_of_rooms(rooms, snapshots, params.view)
    planned = _canvases(faces, base[faces.walls], top[faces.walls], params.pixel_m)
    layers = layered(points, planned, params.astray_m + params.relief_m)
    thickness = np.where(np.isnan(faces.thickness_m), np.inf, faces.thickness_m)
    within = np.clip(thickness / 2, LAYER_M, params.astray_m)
    stands = np.array([standing(layers, f, params.astray_m, within[f]) for f in range(len(faces))])
    canvases = [canvas.moved(depth) for canvas, depth in zip(planned, stands, strict=True)]
    if params.pixel_m < params.coarsest_m:
        votes = _cast(faces, canvases, thickness - stands, eyes, points, params)
    else:
        votes = [uncast(canvas) for canvas in canvases]
    behind = np.clip(thickness - stands - params.other_face_m, params.d, params.relief_m)
    reliefs = [relief(layers, f, stands[f], params.relief_m, behind[f]) for f in range(len(faces))]
    seen = [labelled(*of_face, params.empty_share) for of_face in zip(votes, reliefs, strict=True)]
    over_doors = round(params.over_m / params.pixel_m)
    sure = scanned(seen, faces.opposite, over_doors, params.least_wall)
    for face in np.flatnonzero(assumed[faces.rooms] & ~sure):
        seen[face] = without_holes(seen[face])
    return WallImages(
        pixel_m=params.pixel_m,
        walls=faces.walls,
        rooms=faces.rooms,
        opposite=faces.opposite,
        origins=np.array([canvas.origin[:2] for canvas in canvases]).reshape(-1, 2),
        axes=faces.axes,
        base_m=base[faces.walls],
        labels=tuple(label for label, _, _ in seen),
        depths=tuple(depth for _, depth, _ in seen),
        empty=tuple(empty for _, _, empty in seen),
        rays=np.array([vote.cast for vote in votes], np.int64),
    )


def trace_layout_walls(
    rooms: LayoutRooms,
    walls: LayoutWalls,
    points: list[PointCloud],
    snapshots: list[Snapshots],
    params: TraceParams,
) -> WallImages:
    """Return what is seen of every wall face of the plan its grammar has corrected."""
    return trace_walls(rooms.rooms, walls.walls, points, snapshots, params)


def as_coarse(params: TraceParams, spacing: float) -> TraceParams:
    """Return the parameters with lengths no finer than what points of a spacing can show.

    Parameters
    ----------
    spacing : float
        Distance of neighbouring points, metres.
    """
    edge = params.per_spacing * spacing
    voxel = max(params.voxel_m, edge)
    coarser = {
        "pixel_m": max(params.pixel_m, edge),
        "voxel_m": voxel,
        # a ray meets a surface up to a voxel before it, or beside it
        "d": max(params.d, voxel),
        "aside_m": max(params.aside_m, voxel),
    }
    return params.model_copy(update=coarser)


def _spacing(
    walls: Walls,
    base: NDArray[np.float64],
    top: NDArray[np.float64],
    points: list[PointCloud],
) -> float:
    """Return the distance of neighbouring points in the box the walls stand in."""
    if not len(walls):
        return FINEST_M
    ends = walls.lines.reshape(-1, 2)
    low = np.append(ends.min(axis=0), base.min()) - AIR_M
    return spacing_m(points, low, np.append(ends.max(axis=0), top.max()) + AIR_M)


def _heights(
    walls: Walls, points: list[PointCloud]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    base, top = walls.base_m.copy(), walls.top_m.copy()
    of_points = [c.xyz[:, 2] + c.origin[2] for c in points if len(c)]
    for heights, stand_in in ((base, np.min), (top, np.max)):
        known = ~np.isnan(heights)
        if known.all():
            continue
        if known.any():
            heights[~known] = np.median(heights[known])
        else:
            heights[:] = stand_in([stand_in(z) for z in of_points]) if of_points else 0.0
    return base, top


def _canvases(
    faces: WallFaces, base: NDArray[np.float64], top: NDArray[np.float64], pixel: float
) -> list[Canvas]:
    sizes = np.column_stack([faces.lengths, top - base])
    shapes = np.maximum(np.rint(sizes / pixel).astype(int), 1)
    return [
        Canvas(np.append(origin, low), axis, (int(columns), int(rows)), pixel)
        for origin, low, axis, (columns, rows) in zip(
            faces.origins, base, faces.axes, shapes, strict=True
        )
    ]


def _cast(
    faces: WallFaces,
    canvases: list[Canvas],
    thickness: NDArray[np.float64],
    eyes: list[Eyes],
    points: list[PointCloud],
    params: TraceParams,
) -> list[Votes]:
    """Cast the rays of all faces, in threads."""
    if not canvases:
        return []
    corners = np.concatenate([canvas.corners() for canvas in canvases])
    low, high = corners.min(axis=0) - AIR_M, corners.max(axis=0) + AIR_M
    field = distance_field(points, params.voxel_m, params.least_points, low, high)

    def one(face: int) -> Votes:
        return _votes(field, canvases[face], eyes[faces.rooms[face]], thickness[face], params)

    return spread(one, range(len(faces)))


def _eyes_of_rooms(
    rooms: Rooms, snapshots: list[Snapshots], params: ViewParams
) -> tuple[list[Eyes], NDArray[np.bool_]]:
    """Return where rays start in each room, and whether these places are assumed ones."""
    every = snapshot_eyes(snapshots, params)
    known = rooms.floor_m[~np.isnan(rooms.floor_m)]
    usual = float(np.median(known)) if len(known) else 0.0
    found: list[Eyes] = []
    assumed: list[bool] = []
    for polygon, floor in zip(rooms.polygons, rooms.floor_m, strict=True):
        eyes = of_room(every, polygon, params.near_room_m)
        assumed.append(not len(eyes))
        if assumed[-1]:
            eyes = interior_eyes(polygon, usual if np.isnan(floor) else float(floor), params)
        found.append(eyes)
    return found, np.array(assumed, bool)


def _votes(
    field: DistanceField, canvas: Canvas, eyes: Eyes, thickness: float, params: TraceParams
) -> Votes:
    deep = max(params.d, thickness) if np.isfinite(thickness) else params.d
    looks = (
        (params.least_incidence, params.enough_rays),
        (params.least_grazing, params.enough_grazing),
    )
    rounds = []
    for least_cosine, enough in looks:
        limits = Limits(
            before_m=params.d,
            through_m=deep + params.d_0,
            aside_m=params.aside_m,
            behind_m=params.behind_m,
            least_cosine=least_cosine,
            enough=enough,
            # a snapshot looked there and would have seen a wall; an assumed place tells nothing
            need_background=eyes.all_round,
        )
        rounds.append((chosen(eyes, canvas, least_cosine, params.view.snapshots), limits))
    return cast_rays(field, canvas, rounds)
