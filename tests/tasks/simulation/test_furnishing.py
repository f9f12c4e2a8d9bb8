"""Furniture: what rooms of a class hold, and how it stands."""

from functools import cache

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon, box

from storage.plan import PlanFurniture, PlanOpening, PlanRoom
from tasks.simulation import furniture
from tasks.simulation.furnishing import FurnishingParams, furnish
from tasks.simulation.placing import along_walls, in_the_open, on_grid

ELL = Polygon([(0, 0), (9, 0), (9, 4), (5, 4), (5, 9), (0, 9)])


@cache
def furnished(class_: str, seed: int = 0, **params) -> tuple[PlanFurniture, ...]:
    """Return the furniture of an 8 x 6 m room with a door in the middle of its south wall."""
    room = PlanRoom("r", box(0, 0, 8, 6), class_, floor_m=0.0, ceiling_m=2.8)
    door = PlanOpening("d", LineString([(3.5, -0.1), (4.5, -0.1)]), rooms=("r",))
    rng = np.random.default_rng(seed)
    return furnish((room,), (door,), FurnishingParams(**params), rng)


def kinds(pieces: tuple[PlanFurniture, ...]) -> set[str]:
    return {piece.id.split("-")[0] for piece in pieces}


@pytest.mark.parametrize(
    ("class_", "holds"),
    [
        ("office", {"desk", "swivel", "cabinet", "clutter"}),
        ("executive", {"desk", "swivel", "table", "chair"}),
        ("open_office", {"desk", "swivel", "screen", "column"}),
        ("seminar", {"table", "chair", "clutter"}),
        ("meeting", {"table", "chair"}),
        ("lab", {"bench", "clutter"}),
        ("kitchen", {"counter", "cabinet", "table", "chair"}),
        ("storage", {"shelf"}),
        ("wc", {"counter"}),
        ("stairs", set()),
    ],
)
def test_a_room_holds_what_its_class_is_for(class_, holds):
    assert holds <= kinds(furnished(class_))
    assert bool(holds) == bool(furnished(class_))


@pytest.mark.parametrize("class_", ["office", "open_office", "seminar", "meeting", "storage"])
def test_the_floor_before_a_door_stays_clear(class_):
    for seed in range(3):
        # the leaf turns over one metre; people pass
        swing = box(3.5, 0, 4.5, 1.0)
        assert not any(f.footprint.intersects(swing) for f in furnished(class_, seed))


def test_pieces_have_the_classes_and_heights_of_their_kind():
    for class_ in ("office", "executive", "kitchen", "lab", "seminar", "open_office"):
        for piece in furnished(class_):
            match piece.class_:
                case "table":
                    assert (piece.base_m, piece.top_m) in ((0.0, 0.74), (0.0, 0.9))
                case "chair":
                    # the quantiles of the catalogue, 77 to 107 cm, and a little more
                    assert 0.77 <= piece.top_m <= 1.1
                    side = np.sqrt(piece.footprint.area)
                    assert 0.42 - 1e-9 <= side <= 0.54 + 1e-9
                case _:
                    assert piece.class_ == "other"


def test_chairs_are_pushed_in_in_the_stated_share():
    def pushed_in(share: float) -> float:
        pieces = furnished("seminar", 0, p_pushed_in=share)
        tables = shapely.union_all([p.footprint for p in pieces if p.class_ == "table"])
        chairs = [p.footprint for p in pieces if p.class_ == "chair"]
        return float(np.mean([chair.intersection(tables).area > 0.01 for chair in chairs]))

    assert pushed_in(0.0) == 0.0
    # the others touch in pairs and stand before their table
    assert pushed_in(1.0) > 0.3


def test_some_chairs_touch_and_none_overlap():
    chairs = [p.footprint for s in range(3) for p in furnished("seminar", s) if p.class_ == "chair"]
    per_seed = [
        [p.footprint for p in furnished("seminar", s) if p.class_ == "chair"] for s in range(3)
    ]
    assert len(chairs) > 20
    gaps, shared = [], []
    for places in per_seed:
        for i, a in enumerate(places):
            for b in places[:i]:
                gaps.append(a.distance(b))
                shared.append(a.intersection(b).area)
    assert max(shared) < 1e-9
    assert sum(gap < 1e-6 for gap in gaps) >= 3


def test_a_column_grid_of_no_columns_has_none():
    assert "column" not in kinds(furnished("open_office", 0, column_m=0.0))


@pytest.mark.parametrize("places", [along_walls, in_the_open, on_grid])
def test_places_keep_the_size_of_what_they_place(places):
    rng = np.random.default_rng(0)
    make = lambda r: furniture.table_with_chairs(1.4, 0.8, 2, 0.5, r)  # noqa: E731
    found = list(places(make, ELL, rng))
    assert found
    for place, group in found:
        floor = Polygon(place(group.floor))
        assert floor.area == pytest.approx(Polygon(group.floor).area)
        assert (
            Polygon(group.floor)
            .buffer(1e-9)
            .contains(shapely.union_all([Polygon(p.corners) for p in group.pieces]))
        )


def test_groups_along_walls_have_their_backs_to_a_wall_of_any_room():
    rng = np.random.default_rng(1)
    inside = 0
    for place, group in along_walls(lambda r: furniture.cabinets(2, r), ELL, rng):
        back = place(np.array([(0.0, 0.0)]))[0]
        assert ELL.exterior.distance(shapely.Point(back)) < 1e-9
        inside += ELL.contains(Polygon(place(group.floor)))
    assert inside > 20


@pytest.mark.parametrize("turn", [furniture.turned, furniture.sideways])
def test_a_quarter_turn_swaps_the_sides_of_a_group(turn):
    desk = furniture.workplace(0.5, np.random.default_rng(2))
    after = turn(desk)
    before = np.subtract(desk.high, desk.low)
    assert np.subtract(after.high, after.low) == pytest.approx(before[::-1])
    areas = [[Polygon(p.corners).area for p in group.pieces] for group in (desk, after)]
    assert areas[0] == pytest.approx(areas[1])
    floor = Polygon(after.floor).buffer(1e-9)
    assert all(floor.contains(Polygon(p.corners)) for p in after.pieces)
