"""Knowledge extraction against the plans that perfect initial models are made of."""

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
import shapely
from shapely.affinity import affine_transform, rotate

from grammars.generator.reference_lines import corridor_lines
from grammars.model import Grammar, Part, ReferenceLine, Rule
from storage.faces import SEEN_WALL, Faces
from storage.observations import Observations, from_table, to_table
from storage.rooms import Rooms
from tasks.layout.extraction.observations import ExtractParams, extract_observations
from tasks.layout.extraction.reference_lines import LineParams
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.presets import preset

GRAMMAR = Grammar(
    name="any",
    building_type="office",
    about="",
    learnt_from=(),
    simulated=True,
    classes=("office",),
    rules=(Rule("r1", (Part("office", 4.8, 0.3),), 1.0),),
    p_relation=np.ones((1, 1)),
    partition_m=0.125,
    partition_spread_m=0.02,
)
HEIGHT = 2.8
MM = 1e-3
LAYOUTS = ("small", "ring", "double_loaded", "irregular", "open_plan")
STOREYS = ["ring", "wing", *(f"{layout}-{seed}" for layout in LAYOUTS for seed in (1, 2))]


@cache
def storey(name):
    if "-" not in name:
        return preset(name)
    layout, seed = name.split("-")
    return make_storey(StoreyParams(layout=layout, seed=int(seed)), "b", "1")


def rooms_of(polygons):
    n = len(polygons)
    made = np.empty(n, object)
    made[:] = [shapely.orient_polygons(p) for p in polygons]
    whole = np.ones(n)
    return Rooms(made, np.zeros(n), np.full(n, HEIGHT), whole, whole, ((0,),) * n)


def faces_of(polygons):
    """Return the rooms' walls, each edge a face that one scan saw from floor to ceiling."""
    rings = [np.empty((0, 2))] + [
        shapely.get_coordinates(ring)
        for p in polygons
        for ring in shapely.get_rings(shapely.orient_polygons(p))
    ]
    lines = np.concatenate([np.stack([r[:-1], r[1:]], axis=1) for r in rings])
    steps = lines[:, 1] - lines[:, 0]
    lengths = np.linalg.norm(steps, axis=1)
    normals = np.column_stack([-steps[:, 1], steps[:, 0], 0 * lengths]) / lengths[:, None]
    k = len(lines)
    return Faces(
        normals=normals,
        offsets=np.einsum("kx,kx->k", normals[:, :2], lines[:, 0]),
        sides=np.ones(k, np.int8),
        lines=lines,
        heights=np.tile([0.0, HEIGHT], (k, 1)),
        weights=lengths * HEIGHT,
        scans=np.ones(k, np.int64),
        profiles=tuple(
            np.full(max(1, int(np.ceil(a / 0.1 - 1e-9))), SEEN_WALL, np.uint8) for a in lengths
        ),
        bin_m=0.1,
    )


def extracted(polygons):
    polygons = list(polygons)
    return extract_observations(
        rooms_of(polygons), faces_of(polygons), [], GRAMMAR, ExtractParams()
    )


def outlines(plan):
    return [room.polygon for room in plan.rooms]


def frames(found):
    """Return start, direction, left and length of each line."""
    along = (found.ends - found.starts) / found.lengths_m[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    return list(zip(found.starts, along, left, found.lengths_m, strict=True))


def walls_across(plan, start, along, left):
    """Return where along a line the plan's walls stand square on it, from its left side."""
    at = []
    for wall in plan.walls:
        ends = np.array(wall.line.coords)[:, :2] - start
        x, y = ends @ along, np.sort(ends @ left)
        # a partition's centre line ends at that of the corridor's wall, half its thickness away
        if abs(x[1] - x[0]) < 0.03 * (y[1] - y[0]) and -0.5 < y[0] < 0.3 and y[1] > 0.7:
            at.append(x.mean())
    return np.array(at)


@pytest.mark.parametrize("name", STOREYS)
def test_cuts_are_the_centres_of_the_plans_walls_to_the_millimetre(name):
    plan = storey(name)
    found = extracted(outlines(plan))
    assert len(found.cut_m)
    for i, (start, along, left, length) in enumerate(frames(found)):
        walls = walls_across(plan, start, along, left)
        cuts = found.cut_m[found.lines == i]
        inside = walls[(walls > 0.5) & (walls < length - 0.5)]
        assert cuts == pytest.approx(np.unique(np.round(inside, 4)), abs=MM)
        ends = found.from_m[found.interval_lines == i][0], found.to_m[found.interval_lines == i][-1]
        assert ends == pytest.approx((0, length))


@pytest.mark.parametrize("name", STOREYS)
def test_a_line_knows_the_faces_of_the_walls_it_ends_at(name):
    plan = storey(name)
    found = extracted(outlines(plan))
    rooms = shapely.union_all(outlines(plan))
    some = 0
    for i, (start, along, left, length) in enumerate(frames(found)):
        for end, at in enumerate((0.0, length)):
            lower, upper = found.end_faces_m[i, end]
            assert np.isnan(found.end_sigma_m[i, end]) <= np.isnan([lower, upper]).all()
            for face, inwards in ((lower, -1), (upper, 1)):
                if not np.isnan(face):
                    some += 1
                    assert (face - at) * inwards > 0.05
                    probe = start + face * along + 1.5 * left
                    beside = shapely.points([probe + s * inwards * 0.02 * along for s in (-1, 1)])
                    assert rooms.intersects(beside).tolist() == [False, True]
    assert some >= len(found) / 2  # others end at a wall that is not square on them


@pytest.mark.parametrize("name", STOREYS)
def test_each_room_along_a_corridor_stands_on_one_line_and_in_its_interval(name):
    plan = storey(name)
    found = extracted(outlines(plan))
    corridor = plan.rooms[0].polygon
    homes = {}
    for i, room, a, b in zip(
        found.interval_lines, found.rooms, found.from_m, found.to_m, strict=True
    ):
        start, along, left, _ = frames(found)[i]
        middle = start + (a + b) / 2 * along + 0.8 * left
        assert plan.rooms[room].polygon.covers(shapely.Point(middle))
        homes.setdefault(int(room), set()).add(int(i))
    assert all(len(lines) == 1 for lines in homes.values())
    assert 0 not in homes
    # a room shares a wall of a door's width or more with the corridor, or it is not along it
    beside = {
        i
        for i, room in enumerate(plan.rooms[1:], 1)
        if corridor.buffer(0.25, join_style="mitre").intersection(room.polygon.boundary).length > 2
    }
    across_the_end = {i for i in beside if plan.rooms[i].class_ == "meeting"}
    assert beside - across_the_end <= set(homes)


@pytest.mark.parametrize("layout", ["double_loaded", "small", "wing"])
def test_widths_are_those_of_the_modules_the_storey_was_drawn_with(layout):
    plan = storey("wing" if layout == "wing" else f"{layout}-1")
    found = extracted(outlines(plan))
    whole = np.array([np.sum(found.to_m[m] - found.from_m[m]) for m in _each_line(found)])
    assert whole == pytest.approx(found.lengths_m)
    assert np.ptp(found.lengths_m) < MM  # both sides of one straight corridor
    if layout != "small":
        widths = found.to_m - found.from_m
        plain = np.array([found.rooms.tolist().count(r) == 1 for r in found.rooms])
        plain &= ~np.isin(found.rooms, [11, 12] if layout == "wing" else [])  # one in the other
        assert widths[plain] / 2.4 == pytest.approx(np.round(widths[plain] / 2.4), abs=MM)


def _each_line(found):
    return [found.interval_lines == i for i in range(len(found))]


def test_the_published_ring_has_its_eight_lines_around_the_corridor():
    published = [4.77, 19.46, 4.91, 21.86, 4.91, 19.46, 4.88, 21.86]
    plan = storey("ring")
    found = extracted(outlines(plan))
    middle = np.array(plan.rooms[0].polygon.centroid.coords[0])
    outer = [
        length
        for start, along, left, length in frames(found)
        if (start + length / 2 * along - middle) @ left > 0
    ]
    assert sorted(outer) == pytest.approx(sorted(published), abs=MM)


def test_where_a_corridors_corner_was_not_seen_the_oblique_walls_tell_the_lines_ends():
    polygons = outlines(storey("ring"))
    whole = extracted(polygons)
    corners = shapely.points(shapely.get_coordinates(polygons[0].exterior))
    hidden = shapely.union_all(shapely.buffer(corners, 0.6))
    found = extracted([polygons[0].difference(hidden), *polygons[1:]])
    assert sorted(found.lengths_m) == pytest.approx(sorted(whole.lengths_m), abs=MM)
    assert sorted(found.cut_m) == pytest.approx(sorted(whole.cut_m), abs=MM)


def test_depth_is_from_the_line_to_the_face_of_the_facade():
    plan = storey("double_loaded-1")
    found = extracted(outlines(plan))
    wall, outer = 0.24, 0.3
    south, north = 5.4, 4.8  # between centre lines, of both rows
    expected = {round(d + wall / 2 - outer / 2, 6) for d in (south, north)}
    assert set(np.round(found.depth_m, 6)) == expected


def test_depth_ends_at_the_first_wall_of_a_room_that_goes_on_behind():
    polygons = outlines(storey("double_loaded-1"))
    whole = extracted(polygons)
    k = int(np.flatnonzero(whole.to_m - whole.from_m > 4)[0])
    room, (start, along, left, _) = whole.rooms[k], frames(whole)[whole.interval_lines[k]]
    a, b = whole.from_m[k], whole.to_m[k]
    corners = [(a - 0.1, 2.0), (b - 0.3, 2.0), (b - 0.3, 2.4), (a - 0.1, 2.4)]
    slab = shapely.Polygon([start + x * along + y * left for x, y in corners])
    polygons[room] = polygons[room].difference(slab)
    found = extracted(polygons)
    assert found.depth_m[k] == pytest.approx(2.0)
    assert np.delete(found.depth_m, k) == pytest.approx(np.delete(whole.depth_m, k))


def test_a_wall_nearer_to_a_rows_end_than_any_room_is_wide_is_none():
    polygons = outlines(storey("double_loaded-1"))
    whole = extracted(polygons)
    for far in (False, True):
        start, along, left, length = frames(whole)[0]
        a, b = (length - 0.65, length - 0.55) if far else (0.55, 0.65)
        corners = [(a, 0.3), (b, 0.3), (b, 5.0), (a, 5.0)]
        board = shapely.Polygon([start + x * along + y * left for x, y in corners])
        found = extract_observations(
            rooms_of(polygons), faces_of([*polygons, board]), [], GRAMMAR, ExtractParams()
        )
        assert found.cut_m == pytest.approx(whole.cut_m)


def test_an_l_that_reaches_behind_its_neighbour_keeps_both_widths():
    plan = storey("small-1")
    found = extracted(outlines(plan))
    ell, behind = 1, 2  # the north row's first room, and the one it reaches behind
    at = {int(r): (a, b) for r, a, b in zip(found.rooms, found.from_m, found.to_m, strict=True)}
    assert at[ell][1] == at[behind][0]
    depths = dict(zip(found.rooms.tolist(), found.depth_m, strict=True))
    assert depths[behind] < depths[ell] - 1.5


@pytest.mark.parametrize("name", ["ring", "wing", "small-1", "irregular-1"])
def test_a_turned_and_shifted_storey_gives_turned_and_shifted_observations(name):
    polygons = outlines(storey(name))
    angle, shift = 1.1, np.array([37.0, -12.5])
    c, s = np.cos(angle), np.sin(angle)
    moved = [affine_transform(p, [c, -s, s, c, *shift]) for p in polygons]
    before, after = extracted(polygons), extracted(moved)
    assert after.starts == pytest.approx(before.starts @ [[c, s], [-s, c]] + shift, abs=1e-6)
    assert after.cut_m == pytest.approx(before.cut_m, abs=1e-6)
    assert after.depth_m == pytest.approx(before.depth_m, abs=1e-6)
    assert after.rooms.tolist() == before.rooms.tolist()


@pytest.mark.parametrize("name", ["wing", "small-1", "irregular-1", "double_loaded-1"])
def test_a_mirrored_storey_gives_the_same_lines_walked_the_other_way(name):
    polygons = outlines(storey(name))
    mirrored = [affine_transform(p, [-1, 0, 0, 1, 0, 0]) for p in polygons]
    before, after = extracted(polygons), extracted(mirrored)
    assert len(before) == len(after)
    flip = np.array([-1.0, 1.0])
    for i in range(len(before)):
        off = np.abs(after.starts - before.ends[i] * flip).max(axis=1)
        j = int(off.argmin())
        assert off[j] < MM
        assert after.ends[j] == pytest.approx(before.starts[i] * flip, abs=MM)
        there = before.lengths_m[i] - after.cut_m[after.lines == j][::-1]
        assert there == pytest.approx(before.cut_m[before.lines == i], abs=MM)
        rooms = after.rooms[after.interval_lines == j][::-1].tolist()
        assert rooms == before.rooms[before.interval_lines == i].tolist()


def test_without_a_wall_its_cut_is_missing_and_the_rest_intact():
    polygons = outlines(storey("wing"))
    whole = extracted(polygons)
    k = int(np.flatnonzero(whole.lines == 1)[3])
    a, b = whole.rooms[k + 1], whole.rooms[k + 2]  # the line before holds one interval more
    gap = shapely.union_all([polygons[a], polygons[b]]).convex_hull
    joined = [gap if i == a else p for i, p in enumerate(polygons) if i != b]
    found = extracted(joined)
    assert found.lengths_m == pytest.approx(whole.lengths_m)
    assert found.cut_m == pytest.approx(np.delete(whole.cut_m, k), abs=1e-6)
    widths = np.delete(whole.to_m - whole.from_m, k + 2)
    widths[k + 1] = whole.to_m[k + 2] - whole.from_m[k + 1]
    assert found.to_m - found.from_m == pytest.approx(widths, abs=1e-6)


def test_a_room_that_lies_open_to_the_corridor_is_bridged():
    polygons = outlines(storey("wing"))
    whole = extracted(polygons)
    room = int(whole.rooms[whole.interval_lines == 1][4])
    start, along, left, _ = frames(whole)[1]
    a, b = (x[whole.rooms == room][0] for x in (whole.from_m, whole.to_m))
    ends = [start + x * along + y * left for x, y in ((a + 0.2, -0.5), (b - 0.2, -0.5))]
    ends += [start + x * along + y * left for x, y in ((b - 0.2, 0.6), (a + 0.2, 0.6))]
    open_ = shapely.union_all([polygons[0], polygons[room], shapely.Polygon(ends)])
    polygons[0] = open_
    found = extracted([p for i, p in enumerate(polygons) if i != room])
    assert len(found) == len(whole)
    for i, (start, _, _, length) in enumerate(frames(whole)):
        j = int(np.linalg.norm(found.starts - start, axis=1).argmin())
        assert found.starts[j] == pytest.approx(start, abs=MM)
        assert found.lengths_m[j] == pytest.approx(length, abs=MM)
        assert found.cut_m[found.lines == j] == pytest.approx(whole.cut_m[whole.lines == i])
    assert found.rooms[np.abs(found.from_m - a) < MM].tolist().count(0) == 1


def test_a_row_reaches_on_where_rooms_were_not_mapped_along_the_corridor():
    polygons = outlines(storey("wing"))
    whole = extracted(polygons)
    last = int(whole.rooms[whole.interval_lines == 1][-1])
    found = extracted([p for i, p in enumerate(polygons) if i != last])
    mine = found.interval_lines == 1
    # the wall beside the gap shows one face, half a partition off its centre as all others
    assert found.from_m[mine] == pytest.approx(whole.from_m[whole.interval_lines == 1], abs=MM)
    assert found.rooms[mine][-1] == -1
    assert np.isnan(found.depth_m[mine][-1])
    # nobody saw the end wall: the corridor's end stands for it
    assert found.lengths_m[1] == pytest.approx(whole.lengths_m[1], abs=0.31)


def test_walls_that_no_scan_saw_are_less_sure_and_less_probable():
    polygons = outlines(storey("wing"))
    nothing = faces_of(polygons)
    unseen = replace(nothing, profiles=tuple(0 * p for p in nothing.profiles))
    params = ExtractParams()
    seen = extract_observations(rooms_of(polygons), nothing, [], GRAMMAR, params)
    found = extract_observations(rooms_of(polygons), unseen, [], GRAMMAR, params)
    assert found.cut_m == pytest.approx(seen.cut_m, abs=MM)
    assert (found.sigma_m > 3 * seen.sigma_m).all()
    assert (found.presence < seen.presence).all()
    assert np.isnan(found.faces_m).all() and not found.scans.any()
    thickness = seen.faces_m[:, 1] - seen.faces_m[:, 0]
    assert set(np.round(thickness, 3)) == {0.125, 0.24}  # partitions, walls of stairs


@pytest.mark.parametrize("name", ["ring-1", "wing", "small-2", "ring"])
def test_lines_of_a_grammar_give_what_the_corridors_own_give(name):
    polygons = outlines(storey(name))
    own = extracted(polygons)
    # as a planner draws them: along the corridor's faces, no further than the corridor
    drawn = corridor_lines(polygons[0], 3.0)
    lines = tuple(ReferenceLine(f"l{i}", "1", tuple(a), tuple(b)) for i, (a, b) in enumerate(drawn))
    grammar = replace(GRAMMAR, lines=lines)
    moved = [rotate(p, 20, origin=(0, 0)) for p in polygons]
    for source, storey_ in (("grammar", polygons), ("aligned", moved)):
        params = ExtractParams(line=LineParams(lines=source))
        found = extract_observations(rooms_of(storey_), faces_of(storey_), [], grammar, params)
        assert len(found) == len(own)
        for i in range(len(own)):
            rooms = own.rooms[own.interval_lines == i].tolist()
            (j,) = [
                j
                for j in range(len(found))
                if found.rooms[found.interval_lines == j].tolist() == rooms
            ]
            assert found.lengths_m[j] == pytest.approx(own.lengths_m[i], abs=5 * MM)
            cuts = own.cut_m[own.lines == i]
            assert found.cut_m[found.lines == j] == pytest.approx(cuts, abs=5 * MM)


def test_a_line_of_the_grammar_where_nothing_was_mapped_is_one_empty_interval():
    polygons = outlines(storey("small-1"))
    away = ReferenceLine("away", "1", (100.0, 0.0), (112.0, 0.0))
    params = ExtractParams(line=LineParams(lines="grammar"))
    found = extract_observations(
        rooms_of(polygons), faces_of(polygons), [], replace(GRAMMAR, lines=(away,)), params
    )
    assert found.line_ids.tolist() == ["away"]
    assert (found.from_m.tolist(), found.to_m.tolist()) == ([0.0], [12.0])
    assert found.rooms.tolist() == [-1] and np.isnan(found.depth_m).all()


def test_a_storey_without_corridor_has_no_observations():
    squares = [shapely.box(5 * x, 5 * y, 5 * x + 4.9, 5 * y + 4.9) for x in (0, 1) for y in (0, 1)]
    found = extracted(squares)
    assert len(found) == 0 and len(found.cut_m) == 0 and len(found.rooms) == 0
    assert len(extracted([])) == 0
    assert to_table(found).num_rows == 0


def test_the_same_model_gives_the_same_bytes_and_they_survive_storage():
    polygons = [rotate(p, 7, origin=(0, 0)) for p in outlines(storey("wing"))]
    first, second = extracted(polygons), extracted(polygons)
    assert to_table(first).equals(to_table(second))
    back = from_table(to_table(first))
    for field in fields(Observations):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(first, field.name))


def muddle(seed):
    """Return rooms about a corridor that no one planned: boxes, each less those before it."""
    rng = np.random.default_rng(seed)
    found = [shapely.box(0, 14, 30, 16)]
    for _ in range(25):
        x, y = rng.uniform(0, 30, 2)
        room = shapely.box(x, y, x + rng.uniform(0.3, 25), y + rng.uniform(0.3, 6))
        room = rotate(room, rng.choice([0, 0, 90, 90, 15]))
        room = room.difference(shapely.union_all(found).buffer(0.1))
        parts = shapely.get_parts(room)
        found += [p for p in parts if p.geom_type == "Polygon" and p.area > 0.5]
    return found


@pytest.mark.parametrize("seed", range(12))
def test_cuts_lie_between_the_ends_and_intervals_between_them_whatever_the_rooms(seed):
    found = extracted(muddle(seed))
    assert len(found)
    for i, (_, _, _, length) in enumerate(frames(found)):
        cuts = found.cut_m[found.lines == i]
        assert (np.diff(np.concatenate([[0], cuts, [length]])) > 0).all()
        mine = found.interval_lines == i
        assert found.from_m[mine].tolist() == [0, *cuts]
        assert found.to_m[mine] == pytest.approx([*cuts, length])
    assert (found.sigma_m > 0).all()
    assert ((found.presence >= 0) & (found.presence <= 1)).all()
    assert (np.isnan(found.depth_m) == (found.rooms < 0)).all()
