"""Ways through rooms: clear of what stands there, connected, and spread over the room."""

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon, box

from tasks.simulation.paths import CELL_M, FROM_FURNITURE_M, PASSING_M, tour

ROOM = box(0, 0, 6, 4)
U_SHAPE = Polygon([(0, 0), (6, 0), (6, 5), (4, 5), (4, 2), (2, 2), (2, 5), (0, 5)])


def rng():
    return np.random.default_rng(2)


@pytest.mark.parametrize("room", [ROOM, U_SHAPE])
def test_a_way_keeps_clear_of_walls_and_steps_from_place_to_place(room):
    way = tour(room, (), 0.8, 5, rng())
    assert len(way.stops) == 5
    assert (way.stops[0], way.stops[-1]) == (0, len(way.places) - 1)
    # rounding a bend takes a place no further than a cell from where it was
    clear = room.buffer(-PASSING_M + CELL_M / 2)
    assert clear.contains(LineString(way.places))
    stops = shapely.points(way.places[way.stops])
    assert shapely.distance(stops, room.exterior).min() >= 0.8 - 1e-9
    steps = np.linalg.norm(np.diff(way.places, axis=0), axis=1)
    assert steps.max() < 3 * CELL_M


def test_stops_are_spread_over_the_room():
    way = tour(ROOM, (), 0.8, 4, rng())
    stops = way.places[way.stops]
    apart = np.linalg.norm(stops[:, None] - stops[None], axis=2)[~np.eye(4, dtype=bool)]
    assert apart.min() > 1.5
    assert len(tour(ROOM, (), 0.8, 1, rng()).places) == 1


def test_a_way_leads_round_furniture_that_is_in_between():
    desk = box(2.5, 1.2, 3.5, 4)
    way = tour(ROOM, (desk,), 0.5, 6, rng())
    assert not desk.buffer(PASSING_M / 2).intersects(LineString(way.places))
    stops = shapely.points(way.places[way.stops])
    assert shapely.distance(stops, desk).min() >= FROM_FURNITURE_M - 1e-9
    x = way.places[:, 0]
    assert x.min() < 2 and x.max() > 4


def test_what_cannot_be_reached_is_not_visited():
    wall = box(2.5, -1, 2.6, 5)
    way = tour(ROOM, (wall,), 0.5, 6, rng())
    assert way.places[:, 0].min() > 2.6
    assert len(way.stops) == 6


@pytest.mark.parametrize("side", [0.4, 0.9])
def test_a_closet_is_scanned_from_inside(side):
    closet = box(0, 0, side, side)
    way = tour(closet, (), 0.8, 3, rng())
    assert len(way.stops) >= 1
    assert shapely.contains_xy(closet, way.places).all()
