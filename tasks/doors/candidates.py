"""Door and window candidates of every wall face of a storey (Sec. 5)."""

import numpy as np
from numpy.typing import NDArray

from storage.candidates import FEATURES, Candidates
from storage.wall_images import WallImages
from tasks.doors.edges import EdgeParams, find_edges
from tasks.doors.features import FaceView, FeatureParams, features_of
from tasks.doors.lines import LineParams, Lines, level_lines, upright_lines
from tasks.doors.rectangles import SizeParams, door_rectangles, window_rectangles
from tasks.doors.straightening import StraightParams, straightened
from tasks.doors.templates import TemplateParams, template_rectangles
from tasks.doors.windows import Usual, like_usual, usual_window
from tasks.params import Params


class CandidateParams(Params):
    """From images to candidates."""

    straight: StraightParams = StraightParams()
    """What lies behind the wall."""
    edges: EdgeParams = EdgeParams()
    """Edges of the images."""
    lines: LineParams = LineParams()
    """Lines among the edges."""
    sizes: SizeParams = SizeParams()
    """Standard sizes."""
    templates: TemplateParams = TemplateParams()
    """Doors no edge tells."""
    features: FeatureParams = FeatureParams()
    """What is measured of a candidate."""


def find_candidates(images: WallImages, params: CandidateParams) -> Candidates:
    """Return what may be a door or a window on the faces of a storey, with its features.

    Parameters
    ----------
    images : WallImages
        f faces.

    Returns
    -------
    Candidates
        In the order of the faces; a face without lines has none.

    Notes
    -----
    Sec. 5: edges, lines, and rectangles of two upright and two level ones. Doors stand on the
    floor line of their wall, so their lower side is not looked for.
    """
    views = [face_view(images, face, params) for face in range(len(images))]
    lines = [
        (
            upright_lines(view.upright, view.pixel_m, params.lines),
            level_lines(view.level, view.pixel_m, params.lines),
        )
        for view in views
    ]
    outer = [both for both, other in zip(lines, images.opposite, strict=True) if other < 0]
    alike = usual_window(outer, params.sizes)
    found = [
        _rectangles(view, *both, alike, params) for view, both in zip(views, lines, strict=True)
    ]
    faces = np.repeat(np.arange(len(views), dtype=np.int32), [len(some) for some in found])
    rectangles = np.concatenate([*found, np.empty((0, 4))])
    measured = [
        features_of(images, views, face, some, params.features)
        for face, some in enumerate(found)
        if len(some)
    ]
    base = images.base_m[faces]
    return Candidates(
        faces=faces,
        from_m=rectangles[:, 0],
        to_m=rectangles[:, 1],
        sill_m=base + rectangles[:, 2],
        head_m=base + rectangles[:, 3],
        features=np.concatenate([*measured, np.empty((0, len(FEATURES)))]),
    )


def face_view(images: WallImages, face: int, params: CandidateParams) -> FaceView:
    """Return the straightened depths and the edges of one face."""
    labels = images.labels[face]
    straight = straightened(labels, images.depths[face], images.pixel_m, params.straight)
    edges = find_edges(labels, straight, params.straight, params.edges)
    return FaceView(
        labels=labels,
        depth=straight.depth,
        upright=edges.upright,
        level=edges.level,
        noise_m=straight.noise_m,
        back_m=params.straight.back_m,
        pixel_m=images.pixel_m,
    )


def _rectangles(
    view: FaceView, uprights: Lines, levels: Lines, alike: Usual | None, params: CandidateParams
) -> NDArray[np.float64]:
    """Return the rectangles of one face: begin and end along it, sides over its foot, metres."""
    sizes = params.sizes
    width, height = view.size_m()
    depth, pixel_m = view.depth, view.pixel_m
    every = [
        door_rectangles(uprights, levels, width, sizes),
        template_rectangles(
            depth, pixel_m, sizes.door_widths_m, sizes.door_heads_m, params.templates
        ),
        window_rectangles(uprights, levels, height, sizes),
        like_usual(alike, uprights, width, height, sizes),
    ]
    return np.concatenate(every)
