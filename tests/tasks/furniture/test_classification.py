"""From segments to furniture, with forests grown on what the test itself made."""

import hashlib

import numpy as np
import pytest
import shapely
from furniture_rooms import chair, cloud, floor, one_room, panel, plate

from grammars.workplaces.rules import FILE, read_workplaces
from storage.errors import InputError
from storage.forest import write_forest
from storage.layout_rooms import LayoutRooms
from storage.plan import Plan, PlanFurniture
from storage.sources import Source
from tasks.forest import Examples, ForestParams, fit, joined
from tasks.furniture.classification import (
    FurnitureParams,
    classify_furniture,
    classify_furniture_of_layout,
    named,
)
from tasks.furniture.dimensions import CATALOGUE_M, SEAT_M
from tasks.furniture.examples import CLASS_NAMES, RealSizeParams, examples_of, real_sizes
from tasks.furniture.features import FEATURES
from tasks.furniture.homes import HomeParams
from tasks.furniture.segments import FurnitureSegmentParams, find_furniture_segments

RULES = read_workplaces(FILE)


def piece(id_, class_, x, y, width, depth, top, turn=0.0):
    shape = shapely.box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)
    turned = shapely.affinity.rotate(shape, turn, origin=(x, y), use_radians=True)
    return PlanFurniture(id_, turned, class_, 0.0, top)


def room(seed):
    """Return the segments and the truth of a room with two tables, three chairs and a cabinet."""
    rng = np.random.default_rng(seed)
    parts, truth = [floor()], []
    for i, y in enumerate((1.2, 3.8)):
        x, length = rng.uniform(2.0, 4.0), rng.choice((1.2, 1.4, 1.6))
        parts.append(plate(x, y, length, 0.8, 0.74))
        truth.append(piece(f"t{i}", "table", x, y, length, 0.8, 0.74))
    for i, x in enumerate((1.0, 2.5, 4.2)):
        turn = rng.uniform(-0.2, 0.2)
        parts.append(chair(x, 2.5, turn))
        truth.append(piece(f"c{i}", "chair", x, 2.5, 0.48, 0.48, 0.86, turn))
    parts += [plate(5.4, 0.6, 0.8, 0.42, 1.13), panel(5.4, 0.81, 0.8, 0.0, 1.13)]
    truth.append(piece("o0", "other", 5.4, 0.6, 0.8, 0.42, 1.13))
    points = [cloud(*parts, seed=seed)]
    segments = find_furniture_segments(one_room(), points, FurnitureSegmentParams())
    return segments, Plan("made", str(seed), furniture=tuple(truth))


@pytest.fixture(scope="module")
def rooms():
    return [room(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def examples(rooms):
    return joined([examples_of(segments, truth) for segments, truth in rooms[:5]])


@pytest.fixture(scope="module")
def forest(examples):
    both = joined(
        [examples, real_sizes(examples, RealSizeParams(each=40, homes=HomeParams(rooms=0)))]
    )
    return fit(both, FEATURES, CLASS_NAMES, ForestParams(trees=8))


def test_a_room_that_was_not_learnt_from_gets_its_tables_chairs_and_cabinet(rooms, forest):
    segments, truth = rooms[5]
    found = named(segments, one_room(), forest, RULES, FurnitureParams())
    assert sorted(found.classes) == sorted(p.class_ for p in truth.furniture)
    for true in truth.furniture:
        mine = found.classes == true.class_
        shared = shapely.area(shapely.intersection(found.footprints[mine], true.footprint))
        best = int(np.argmax(shared))
        assert shared[best] / true.footprint.area > 0.8
        assert found.top_m[mine][best] == pytest.approx(true.top_m, abs=0.04)
    assert (found.base_m == 0).all() and (found.rooms == 0).all()
    assert ((found.confidences > 0) & (found.confidences <= 1)).all()


def test_one_object_keeps_one_box_the_more_confident_one(rooms, forest):
    segments, _ = rooms[5]
    once = named(segments, one_room(), forest, RULES, FurnitureParams())
    columns = ("features", "footprints", "hulls", "surface_m", "top_m", "base_m", "rooms")
    twice = type(segments)(
        segments.names, *(np.concatenate([getattr(segments, c)] * 2) for c in columns)
    )
    again = named(twice, one_room(), forest, RULES, FurnitureParams())
    assert len(again) == len(once)


def test_a_chair_under_a_table_and_the_table_are_both_kept(rooms, forest):
    parts = [floor(), plate(3, 2.5, 1.6, 0.8, 0.74), chair(3, 2.84)]
    segments = find_furniture_segments(one_room(), [cloud(*parts)], FurnitureSegmentParams())
    # the rooms learnt from have no chair so far under a table: any doubt will do
    found = named(segments, one_room(), forest, RULES, FurnitureParams(chair=0.1, table=0.1))
    assert {"table", "chair"} <= set(found.classes)


def test_no_segments_make_no_furniture(forest):
    segments = find_furniture_segments(one_room(), [cloud(floor())], FurnitureSegmentParams())
    assert len(named(segments, one_room(), forest, RULES, FurnitureParams())) == 0


def test_a_stage_reads_forest_and_rules_and_refuses_those_of_another_kind(
    rooms, forest, examples, tmp_path
):
    segments, _ = rooms[5]
    path = tmp_path / "forest.parquet"
    write_forest(forest, path)
    given = (source(path), source(FILE), FurnitureParams())
    found = classify_furniture(segments, one_room(), *given)
    at_hand = named(segments, one_room(), forest, RULES, FurnitureParams())
    assert found.classes.tolist() == at_hand.classes.tolist()
    text = np.array([""])
    layout = LayoutRooms(one_room(), text, text, np.array([np.nan]), ((0,),), text)
    corrected = classify_furniture_of_layout(segments, layout, *given)
    assert corrected.confidences.tolist() == at_hand.confidences.tolist()
    other = fit(examples, [f"{name} x" for name in FEATURES], CLASS_NAMES, ForestParams(trees=1))
    write_forest(other, path)
    with pytest.raises(InputError, match="features"):
        classify_furniture(segments, one_room(), source(path), source(FILE), FurnitureParams())


def source(path):
    data = path.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    return Source(name=path.name, path=str(path), sha256=digest, size_bytes=len(data))


def test_segments_are_named_by_the_true_plan_and_fragments_teach_nothing(rooms):
    segments, truth = rooms[0]
    examples = examples_of(segments, truth)
    counts = np.bincount(examples.labels, minlength=len(CLASS_NAMES))
    assert counts[CLASS_NAMES.index("table")] == 2
    assert counts[CLASS_NAMES.index("chair")] >= 3
    assert set(examples.groups) == {"made/0"}
    empty = examples_of(segments, Plan("made", "0"))
    assert (empty.labels == CLASS_NAMES.index("nothing")).all() and len(empty) == len(segments)


def test_real_sizes_lie_within_the_catalogue_and_repeat_with_their_seed(examples):
    made = real_sizes(examples, RealSizeParams(each=50, seed=3, homes=HomeParams(rooms=0)))
    chairs = made[made.labels == CLASS_NAMES.index("chair")]
    assert len(chairs) == 50
    height = chairs.features[:, FEATURES.index("distance_m")]
    assert height.min() >= SEAT_M[0] and height.max() <= SEAT_M[1]
    widths = chairs.features[:, FEATURES.index("box_width_m")]
    assert widths.max() <= CATALOGUE_M["chair"]["width"][-1] + 1e-9
    again = real_sizes(examples, RealSizeParams(each=50, seed=3, homes=HomeParams(rooms=0)))
    assert again.features.tobytes() == made.features.tobytes()
    other = real_sizes(examples, RealSizeParams(each=50, seed=4, homes=HomeParams(rooms=0)))
    assert other.features.tobytes() != made.features.tobytes()
    nobody = Examples(np.empty((0, len(FEATURES))), np.empty(0, int), np.empty(0, "U4"))
    assert len(real_sizes(nobody, RealSizeParams(homes=HomeParams(rooms=0)))) == 0
