"""Candidates against a true plan: the examples a classifier of openings learns from."""

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, PositiveFloat

from storage.candidates import FEATURES, Candidates
from storage.openings import STATES
from storage.plan import Plan, PlanOpening
from storage.wall_images import WallImages
from tasks.forest import Examples
from tasks.params import Params

OTHER, WINDOW = "other", "window"
CLASSES = (OTHER, WINDOW, *STATES)
"""What a candidate may be: nothing, a window, or a door whose leaf stands so. The paper tells doors
from the rest; a leaf that stands open, ajar or shut shows such different things that to learn them
apart is easier, and says the state besides."""
DOOR_CLASSES = tuple(CLASSES.index(state) for state in STATES)
"""Places of the doors' classes."""
AMBIGUOUS = -1


class ExampleParams(Params):
    """What a candidate has to share with a true opening to be an example of it."""

    same_iou: float = Field(default=0.6, gt=0, le=1)
    """From this IoU on the wall plane on it is the opening: above what counts as found (0.5), so
    that a better rectangle scores higher. Assumption."""
    other_iou: float = Field(default=0.4, ge=0, le=1)
    """Below this IoU it is none; what lies between teaches nothing. Assumption."""
    off_face_m: PositiveFloat = 0.35
    """How far behind its face an opening's centre line may lie, metres: half of a thick wall and
    what noise adds. Assumption."""
    before_face_m: PositiveFloat = 0.15
    """How far before its face it may lie, metres: noise. Assumption."""


def examples(
    candidates: Candidates, images: WallImages, truth: Plan, params: ExampleParams
) -> Examples:
    """Return the candidates of a storey as examples of known class.

    Parameters
    ----------
    candidates : found on `images`
    truth : the plan of the storey, in the same frame

    Returns
    -------
    Examples
        Labels are places in `CLASSES`; one group, `building/storey`. Candidates that share some of
        an opening but not enough of it are left out, and those of doors of unknown state. Each
        stands beside its mirror image: buildings are built both ways round.
    """
    labels = label(candidates, images, truth, params)
    known = labels != AMBIGUOUS
    group = f"{truth.building}/{truth.storey}"
    features = candidates.features[known]
    both = np.concatenate([features, mirrored(features)])
    return Examples(both, np.tile(labels[known], 2), np.full(2 * known.sum(), group))


def mirrored(features: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the features the same candidates would have in a mirror: left is right."""
    swapped = [
        name.replace("left", "right") if "left" in name else name.replace("right", "left")
        for name in FEATURES
    ]
    return features[:, [FEATURES.index(name) for name in swapped]]


def label(
    candidates: Candidates, images: WallImages, truth: Plan, params: ExampleParams
) -> NDArray[np.int64]:
    """Return the class of each candidate, (n,), by its place in `CLASSES`; AMBIGUOUS for none."""
    labels = np.full(len(candidates), CLASSES.index(OTHER))
    best = np.zeros(len(candidates))
    everything = [(o, WINDOW) for o in truth.windows] + [(o, o.state) for o in truth.doors]
    for opening, class_ in everything:
        iou = _iou(candidates, images, opening, params)
        better = iou > best
        best[better] = iou[better]
        labels[better] = CLASSES.index(class_) if class_ in CLASSES else AMBIGUOUS
    labels[best < params.same_iou] = AMBIGUOUS
    labels[best < params.other_iou] = CLASSES.index(OTHER)
    return labels


def _iou(
    candidates: Candidates, images: WallImages, opening: PlanOpening, params: ExampleParams
) -> NDArray[np.float64]:
    """Return the IoU on the wall plane of each candidate with one opening, 0 off its wall."""
    ends = shapely.get_coordinates(opening.line)[[0, -1]]
    from_origin = ends - images.origins[:, None]
    along = np.einsum("fek,fk->fe", from_origin, images.axes)
    out = np.einsum("fek,fk->fe", from_origin, images.normals())
    on_face = ((out >= -params.off_face_m) & (out <= params.before_face_m)).all(axis=1)
    begin, end = along.min(axis=1)[candidates.faces], along.max(axis=1)[candidates.faces]
    shared = np.minimum(end, candidates.to_m) - np.maximum(begin, candidates.from_m)
    # a height nobody knows is that of the candidate
    sill = candidates.sill_m if opening.sill_m is None else np.full(len(shared), opening.sill_m)
    head = candidates.head_m if opening.head_m is None else np.full(len(shared), opening.head_m)
    high = np.minimum(head, candidates.head_m) - np.maximum(sill, candidates.sill_m)
    both = np.maximum(shared, 0) * np.maximum(high, 0)
    areas = (end - begin) * (head - sill) + (candidates.to_m - candidates.from_m) * (
        candidates.head_m - candidates.sill_m
    )
    iou = both / np.maximum(areas - both, 1e-12)
    return np.where(on_face[candidates.faces], iou, 0.0)
