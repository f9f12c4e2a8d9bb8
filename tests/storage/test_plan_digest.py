"""What a plan is known by: its rooms to the millimetre, whatever they are called and drawn like."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely import LineString, Polygon, affinity, box

from storage.plan import Plan, PlanRoom, PlanWall
from storage.plan_digest import plan_digest
from storage.plan_geojson import read_plan, write_plan
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.presets import preset

L_SHAPED = Polygon([(0, 0), (6.25, 0), (6.25, 3.1), (4, 3.1), (4, 5.5), (0, 5.5)])
ROUND = shapely.Point(20, 5).buffer(3, quad_segs=64)
COURT = box(0, 10, 9, 19).difference(box(3, 13, 6.2, 16))


def plan_of(*polygons, building="hut", storey="0"):
    rooms = tuple(PlanRoom(f"r{i}", polygon, "office") for i, polygon in enumerate(polygons))
    return Plan(building, storey, rooms)


PLAN = plan_of(L_SHAPED, box(6.45, 0, 9.0005, 3.1), ROUND, COURT)


def changed(change, plan=PLAN):
    return replace(
        plan, rooms=tuple(replace(room, polygon=change(room.polygon)) for room in plan.rooms)
    )


def moved(offset_m, plan=PLAN):
    return changed(lambda polygon: affinity.translate(polygon, *offset_m), plan)


def restarted(polygon):
    """Return the same area, its rings started elsewhere."""
    rings = [list(ring.coords)[:-1] for ring in (polygon.exterior, *polygon.interiors)]
    return Polygon(*[rings[0][2:] + rings[0][:2], [ring[1:] + ring[:1] for ring in rings[1:]]])


def noisy(polygon, by_m=2e-5):
    # the same at the same place: rings stay closed
    return shapely.transform(polygon, lambda xy: xy + by_m * np.sin(1e6 * xy + 1))


@pytest.mark.parametrize(
    "same",
    [
        replace(PLAN, building="shed", storey="9", simulated=True, notes=("copied",)),
        replace(PLAN, walls=(PlanWall("w", LineString([(0, 0), (1, 0)])),)),
        replace(PLAN, rooms=PLAN.rooms[::-1]),
        replace(
            PLAN,
            rooms=tuple(
                PlanRoom(f"x{room.id}", room.polygon, "hall", "Hall", 0.0, 3.0)
                for room in PLAN.rooms
            ),
        ),
        changed(shapely.reverse),
        changed(restarted),
        changed(lambda polygon: shapely.segmentize(polygon, 0.7)),
        moved((12.345, -300.001)),
    ],
    ids=["names", "walls", "order", "ids", "orientation", "start", "straight", "shift"],
)
def test_the_same_rooms_are_known_again(same):
    assert plan_digest(same) == plan_digest(PLAN)


@pytest.mark.parametrize(
    "other",
    [
        plan_of(L_SHAPED, box(6.45, 0, 9.002, 3.1), ROUND, COURT),
        plan_of(L_SHAPED, box(6.452, 0, 9.0005, 3.1), ROUND, COURT),
        plan_of(*(room.polygon for room in PLAN.rooms[:-1])),
        plan_of(*(room.polygon for room in PLAN.rooms), box(50, 0, 52, 2)),
        plan_of(L_SHAPED, box(6.45, 0, 9.0005, 3.1), ROUND, box(0, 10, 9, 19)),
        changed(lambda polygon: affinity.scale(polygon, -1, 1, origin=(0, 0))),
        changed(lambda polygon: affinity.rotate(polygon, 90, origin=(0, 0))),
        plan_of(),
    ],
    ids=["wider", "side", "fewer", "more", "court", "mirrored", "rotated", "none"],
)
def test_other_rooms_are_other_plans(other):
    assert plan_digest(other) != plan_digest(PLAN)


def test_a_plan_is_known_from_its_file_and_noise_does_not_count(tmp_path):
    for plan in (PLAN, preset("ring", "b", "0"), make_storey(StoreyParams(seed=4), "b", "0")):
        write_plan(plan, tmp_path / "plan.geojson")
        written = read_plan(tmp_path / "plan.geojson")
        assert plan_digest(written) == plan_digest(plan)
        assert plan_digest(changed(noisy, written)) == plan_digest(plan)
        write_plan(written, tmp_path / "again.geojson")
        assert plan_digest(read_plan(tmp_path / "again.geojson")) == plan_digest(plan)


def test_half_a_millimetre_is_rounded_one_way_whatever_the_noise():
    corners = np.arange(1, 400, 7) / 2000  # every second one ends in half a millimetre
    outline = [(x, 1 + (i % 2)) for i, x in enumerate(corners)]
    zigzag = Polygon([*outline, (corners[-1], -1), (corners[0], -1)])
    for by_m in (1e-12, 1e-9, 4e-5):
        assert plan_digest(changed(lambda p, by=by_m: noisy(p, by), plan_of(zigzag))) == (
            plan_digest(plan_of(zigzag))
        )


def test_storeys_of_different_seeds_are_different_plans():
    digests = {plan_digest(make_storey(StoreyParams(seed=s), "b", "0")) for s in range(8)}
    assert len(digests) == 8
