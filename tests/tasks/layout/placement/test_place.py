"""Placement against the truth of simulated storeys, walls shifted, removed and added."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon, box
from shapely.affinity import affine_transform

from grammars.model import Grammar, Part, Rule
from storage.artifacts import Place, read, write
from storage.layout_rooms import LAYOUT_ROOMS
from storage.observations import Observations
from storage.rooms import Rooms
from storage.walls import Walls
from tasks.evaluation.rooms import ious, match
from tasks.layout.extraction.model import LineFrame
from tasks.layout.placement.cutting import cut, joined
from tasks.layout.placement.oracle import true_layout, true_rules
from tasks.layout.placement.outline import edges_of, moved
from tasks.layout.placement.params import PlacementParams
from tasks.layout.placement.place import place_rooms
from tasks.simulation.plan import StoreyParams, make_storey
from tasks.simulation.presets import preset

PARAMS = PlacementParams(face_sigma_m=0.05)
PROBE_M = 0.6
"""How far from the corridor rooms are asked for: behind its wall."""
PARTITION_M = 0.125


# --- a storey, its lines, and what there is to say along them


def lines_of(polygons):
    """Return the corridor's sides, rooms to their left, from the first room to the last."""
    lines = []
    sides = [LineFrame.between(a, b) for a, b in corridor_sides(polygons[0])]
    for frame, stretches in zip(sides, standing(polygons, sides), strict=True):
        if stretches:
            ends = stretches[0][1] - PARTITION_M / 2, stretches[-1][2] + PARTITION_M / 2
            start = frame.start + ends[0] * frame.along
            lines.append((start, frame.start + ends[1] * frame.along))
    return lines


def corridor_sides(corridor):
    """Yield the corridor's longer sides, rooms to their left."""
    for ring in (corridor.exterior, *corridor.interiors):
        corners = shapely.get_coordinates(shapely.orient_polygons(Polygon(ring)).exterior)
        if ring == corridor.exterior:
            corners = corners[::-1]
        yield from ((a, b) for a, b in pairwise(corners) if np.linalg.norm(b - a) > 2)


def standing(polygons, frames):
    """Return per line (room, from, to) of the rooms on it, in order; never the corridor.

    Of several lines behind which a room lies it stands on the one it has most of.
    """
    every = [_behind(frame, polygons) for frame in frames]
    length = np.zeros((len(frames), len(polygons)))
    for line, stretches in enumerate(every):
        for room, low, high in stretches:
            length[line, room] += high - low
    most = length.argmax(axis=0)
    return [[s for s in stretches if most[s[0]] == line] for line, stretches in enumerate(every)]


def _behind(frame, polygons):
    reach = np.array([(-9.0, PROBE_M), (frame.length + 9.0, PROBE_M)])
    probe = LineString(frame.building(reach))
    common = shapely.intersection(probe, np.array(polygons[1:], object))
    parts, room = shapely.get_parts(common, return_index=True)
    corners, part = shapely.get_coordinates(parts, return_index=True)
    s = frame.local(corners)[:, 0]
    found = []
    for k in np.unique(part):
        low, high = s[part == k].min(), s[part == k].max()
        if min(high, frame.length) - max(low, 0) > 0.5:
            found.append((int(room[k]) + 1, float(low), float(high)))
    return sorted(found, key=lambda stretch: stretch[1])


def observe(polygons, lines, sigma_m=0.05, presence=0.8):
    """Return what rooms say along lines: every wall between two of them seen from both sides."""
    cuts, intervals = [], []
    frames = [LineFrame.between(*ends) for ends in lines]
    for number, (frame, stretches) in enumerate(
        zip(frames, standing(polygons, frames), strict=True)
    ):
        at = 0.0
        for (room, _, below), (_, above, _) in pairwise(stretches):
            cuts.append((number, (below + above) / 2, below, above))
            intervals.append((number, at, cuts[-1][1], room))
            at = cuts[-1][1]
        intervals.append((number, at, frame.length, stretches[-1][0] if stretches else -1))
    cuts, intervals = np.array(cuts).reshape(-1, 4), np.array(intervals)
    return Observations(
        line_ids=np.array([f"l{i}" for i in range(len(lines))]),
        starts=np.array([a for a, _ in lines]),
        ends=np.array([b for _, b in lines]),
        end_sigma_m=np.full((len(lines), 2), np.nan),
        end_faces_m=np.full((len(lines), 2, 2), np.nan),
        lines=cuts[:, 0].astype(int),
        cut_m=cuts[:, 1],
        sigma_m=np.full(len(cuts), sigma_m),
        faces_m=cuts[:, 2:],
        scans=np.ones(len(cuts), int),
        presence=np.full(len(cuts), presence),
        interval_lines=intervals[:, 0].astype(int),
        from_m=intervals[:, 1],
        to_m=intervals[:, 2],
        rooms=intervals[:, 3].astype(int),
        depth_m=np.full(len(intervals), np.nan),
    )


def by_rules(layout, true, lines, width_error_m=0.0, spread_m=0.02, seed=0):
    """Return a grammar and the true layout with its widths.

    A rule is a class with a width and a depth, both to 0.3 m: its sizes are the rooms' mean.
    """
    rng = np.random.default_rng(seed)
    sizes, rules = {}, []
    for line, room, width in zip(layout.line_ids, layout.rules, layout.widths_m, strict=True):
        frame = LineFrame.between(*lines[int(line[1:])])
        depth = frame.local(shapely.get_coordinates(true[int(room)]))[:, 1].max()
        class_ = layout.classes[len(rules)]
        rules.append(f"{class_} {round(width / 0.3)} {round(depth / 0.3)}")
        sizes.setdefault(rules[-1], []).append((width, depth))
    mean = {rule: np.mean(of, axis=0) for rule, of in sizes.items()}
    off = {rule: rng.normal(0, width_error_m) for rule in mean}
    widths = np.array([mean[rule][0] + off[rule] for rule in rules])
    spread = np.full(len(rules), spread_m)
    layout = replace(layout, rules=np.array(rules), widths_m=widths, spreads_m=spread)
    return grammar_of(mean, spread_m), layout


def grammar_of(sizes, spread_m):
    rules = tuple(
        Rule(rule, (Part(rule.split()[0], width, spread_m, depth, spread_m),), 1 / len(sizes))
        for rule, (width, depth) in sizes.items()
    )
    classes = tuple(sorted({rule.parts[0].class_ for rule in rules}))
    even = np.full((len(rules), len(rules)), 1 / len(rules))
    return Grammar(
        "test", "office", "made from a simulated storey", (), True, classes, rules, even,
        PARTITION_M, 0.02,
    )  # fmt: skip


# --- how an initial model goes wrong


def shifted(plan, sigma_m, rng):
    """Return the rooms of a plan, each wall shifted as a whole and its faces a little on top."""
    lines = np.array([shapely.get_coordinates(wall.line) for wall in plan.walls])
    shifts = rng.normal(0, sigma_m, len(lines))
    found = [plan.rooms[0].polygon]
    for room in plan.rooms[1:]:
        edges = edges_of([room.polygon])
        by = []
        for ends, outward in zip(edges.ends, edges.outward, strict=True):
            w = _wall_of(ends, outward, lines)
            normal = np.array([lines[w, 1, 1] - lines[w, 0, 1], lines[w, 0, 0] - lines[w, 1, 0]])
            shift = shifts[w] * np.sign(normal @ outward) + rng.normal(0, sigma_m / 5)
            by.append((shift, shift))
        found.append(moved(room.polygon, np.array(by)))
    return found


def _wall_of(ends, outward, lines):
    along = np.array([-outward[1], outward[0]])
    away = np.abs((lines - ends[0]) @ outward).max(axis=1)
    s = np.sort((lines - ends[0]) @ along, axis=1)
    common = np.minimum(s[:, 1], np.linalg.norm(ends[1] - ends[0])) - np.maximum(s[:, 0], 0)
    return int(np.where(away < 0.2, common, -np.inf).argmax())


def without_walls(polygons, lines, share, rng):
    """Return rooms with a share of the partitions along the lines taken out."""
    owner, polygons = np.arange(len(polygons)), [*polygons]
    pairs = []
    frames = [LineFrame.between(*ends) for ends in lines]
    for stretches in standing(polygons, frames):
        rooms = [room for room, _, _ in stretches]
        pairs += [(a, b) for a, b in pairwise(rooms) if rng.random() < share]
    for a, b in pairs:
        if owner[a] == a and owner[b] == b and a != b:
            whole = joined([polygons[a], polygons[b]], 0.5)
            if whole is not None:
                polygons[a], polygons[b], owner[b] = whole, None, a
    return [p for p in polygons if p is not None]


def with_walls(polygons, lines, share, rng):
    """Return rooms with a share of them cut in two by a wall that is not there."""
    frames = [LineFrame.between(*ends) for ends in lines]
    behind = [room for frame in frames for room in {r for r, _, _ in _behind(frame, polygons)}]
    for frame, stretches in zip(frames, standing(polygons, frames), strict=True):
        for room, low, high in stretches:
            alone = behind.count(room) == 1  # no room in a corner
            if alone and rng.random() < share and high - low > 2:
                at = np.array([low + rng.uniform(0.3, 0.7) * (high - low)])
                if pieces := cut(polygons[room], frame, at, np.array([0.1]), 1.0):
                    polygons = [*polygons[:room], pieces[0], *polygons[room + 1 :], pieces[1]]
                    behind.append(room)  # only once
    return polygons


def initial_model(polygons):
    n = len(polygons)
    rooms = Rooms(
        np.array(polygons, object), np.zeros(n), np.full(n, 2.8), np.ones(n), np.ones(n),
        tuple((i,) for i in range(n)),
    )  # fmt: skip
    edges = edges_of(polygons)
    count = len(edges)
    walls = Walls(
        edges.ends, np.full(count, np.nan), np.zeros(count), np.full(count, 2.8),
        np.column_stack([edges.shape, np.full(count, -1)]).astype(np.int32), np.ones(count),
    )  # fmt: skip
    return rooms, walls


def case_of(plan, seed, shift_m=0.05, missed=0.0, spurious=0.0, **rule_errors):
    """Return the true polygons, an oracle's grammar and layout, and what `place_rooms` takes."""
    rng = np.random.default_rng(seed)
    true = [room.polygon for room in plan.rooms]
    found = shifted(plan, shift_m, rng)
    lines = lines_of(found)
    found = without_walls(found, lines, missed, rng)
    found = with_walls(found, lines, spurious, rng)
    rooms, walls = initial_model(found)
    observed = observe(found, lines)
    classes = [room.class_ for room in plan.rooms]
    known = true_layout(observed, rooms, true, classes, PARTITION_M, same_m=0.15)
    grammar, layout = by_rules(known, true, lines, **rule_errors)
    oracle = replace(grammar, rules=true_rules(known, observed, true)), known
    return true, oracle, (rooms, walls, observed, layout, grammar)


def area_errors(polygons, true):
    """Return the area error of each true room; its whole area where none is matched."""
    overlap = ious(list(polygons), true)
    partner = match(overlap)
    area = np.append(shapely.area(np.array(polygons, object)), 0.0)[partner]
    iou = np.append(overlap, np.zeros((1, len(true))), axis=0)[partner, np.arange(len(true))]
    return np.abs(area - shapely.area(np.array(true, object))), iou


# --- tests


@cache
def storey(name, seed=0):
    if name in ("ring", "wing"):
        return preset(name)
    return make_storey(StoreyParams(seed=seed, layout=name, yaw_rad=0.3), "b", "1")


STOREYS = [("ring", 0), ("wing", 0), ("small", 11), ("double_loaded", 12), ("irregular", 12)]
"""Preset and drawn ones; `ring` is the preset."""


@pytest.mark.parametrize(("name", "seed"), STOREYS)
def test_shifted_walls_go_back_to_where_the_rules_say(name, seed):
    errors = []
    for noise in range(3):
        true, (best, known), args = case_of(storey(name, seed), noise)
        after = place_rooms(*args, PARAMS)
        oracle = place_rooms(*args[:3], known, best, PARAMS)
        assert len(after) == len(oracle) == len(true)
        found = [p.rooms.polygons for p in (after, oracle)]
        errors.append([area_errors(p, true)[0].mean() for p in (args[0].polygons, *found)])
    before, after, oracle = np.mean(errors, axis=0)
    assert after < 0.6 * before
    assert oracle < 0.55 * before


@pytest.mark.parametrize(("name", "seed"), STOREYS)
def test_missed_walls_are_put_in_and_spurious_ones_taken_out(name, seed):
    true, _, args = case_of(storey(name, seed), seed=5, missed=0.2, spurious=0.2)
    before, _ = area_errors(args[0].polygons, true)
    out = place_rooms(*args, PARAMS)
    after, iou = area_errors(out.rooms.polygons, true)
    assert len(out) == len(true)
    assert (iou > 0.8).all()
    assert after.mean() < 0.2 * before.mean()


def test_rooms_know_class_rule_posterior_scans_and_where_they_come_from(tmp_path):
    true, _, args = case_of(storey("wing"), seed=5, missed=0.2, spurious=0.2)
    out = place_rooms(*args, PARAMS)
    partner = match(ious(list(out.rooms.polygons), true))
    classes = [room.class_ for room in storey("wing").rooms]
    assert out.classes[partner].tolist() == ["", *classes[1:]]  # the corridor is on no line
    assert out.posteriors[partner[1:]] == pytest.approx(1.0)
    assert out.explained[partner[1:]].all() and not out.explained[partner[0]]
    for polygon, sources, scans in zip(
        out.rooms.polygons, out.sources, out.rooms.scans, strict=True
    ):
        assert scans == sources  # room i was seen by scan i
        assert all(polygon.intersects(args[0].polygons[i]) for i in sources)
    assert {i for s in out.sources for i in s} == set(range(len(args[0])))
    kept = write(LAYOUT_ROOMS, out, Place(store=str(tmp_path), run="r", building="b", storey="1"))
    again = read(LAYOUT_ROOMS, kept, str(tmp_path))
    assert again.sources == out.sources
    assert again.rules.tolist() == out.rules.tolist()
    assert shapely.equals(again.rooms.polygons, out.rooms.polygons).all()


def transformed(args, matrix, mirror):
    """Return a storey turned and moved, or mirrored: then lines run the other way."""
    rooms, walls, o, layout, grammar = args
    a, b, c, d, x, y = matrix

    def of(xy):
        return xy @ np.array([[a, c], [b, d]]) + (x, y)

    rooms = replace(
        rooms, polygons=np.array([affine_transform(p, matrix) for p in rooms.polygons], object)
    )
    walls = replace(walls, lines=of(walls.lines))
    o = replace(o, starts=of(o.starts), ends=of(o.ends))
    if not mirror:
        return rooms, walls, o, layout, grammar
    length = o.lengths_m
    cuts = np.lexsort((-o.cut_m, o.lines))
    spans = np.lexsort((-o.from_m, o.interval_lines))
    of_cut, of_span = length[o.lines], length[o.interval_lines]
    counts = np.bincount(o.lines, minlength=len(length))
    o = replace(
        o,
        starts=o.ends,
        ends=o.starts,
        cut_m=(of_cut - o.cut_m)[cuts],
        faces_m=(of_cut[:, None] - o.faces_m)[cuts][:, ::-1],
        from_m=(of_span - o.to_m)[spans],
        to_m=(of_span - o.from_m)[spans],
        rooms=o.rooms[spans],
    )
    line = np.array([int(name[1:]) for name in layout.line_ids])
    order = np.lexsort((-layout.orders, line))
    swapped = replace(
        layout,
        from_m=length[line] - layout.to_m,
        to_m=length[line] - layout.from_m,
        from_cuts=_reversed(layout.to_cuts, counts[line]),
        to_cuts=_reversed(layout.from_cuts, counts[line]),
    )
    names = [f for f in vars(layout) if f != "orders"]
    return (
        rooms,
        walls,
        o,
        replace(swapped, **{f: getattr(swapped, f)[order] for f in names}),
        grammar,
    )


def _reversed(cuts, count):
    return np.where(cuts >= 0, count - 1 - cuts, cuts)


@pytest.mark.parametrize(
    ("matrix", "mirror"),
    [((0.6, -0.8, 0.8, 0.6, 30, -7), False), ((-1, 0, 0, 1, 0, 0), True)],
    ids=["turned", "mirrored"],
)
@pytest.mark.parametrize("name", ["wing", "irregular"])
def test_a_turned_or_mirrored_storey_gives_the_same_turned_or_mirrored(name, matrix, mirror):
    _, _, args = case_of(storey(name, 12), seed=5, missed=0.2, spurious=0.2)
    plain = place_rooms(*args, PARAMS)
    other = place_rooms(*transformed(args, matrix, mirror), PARAMS)
    expected = [affine_transform(p, matrix) for p in plain.rooms.polygons]
    overlap = ious(expected, list(other.rooms.polygons))
    assert len(expected) == len(other)
    assert overlap.max(axis=0) == pytest.approx(1.0, abs=1e-6)
    assert sorted(other.rules) == sorted(plain.rules)


def firm(args, sigma_m=0.02):
    o = args[2]
    known = replace(o, sigma_m=np.full(len(o.sigma_m), sigma_m), presence=np.ones(len(o.sigma_m)))
    return (*args[:2], known, *args[3:])


@pytest.mark.parametrize("error_m", [0.3, 1.0])
def test_a_wrong_grammar_does_not_move_what_was_well_observed(error_m):
    true, _, args = case_of(storey("wing"), seed=1, shift_m=0.02, width_error_m=error_m)
    out = place_rooms(*firm(args), PlacementParams())
    before, _ = area_errors(args[0].polygons, true)
    after, _ = area_errors(out.rooms.polygons, true)
    assert after.mean() < 1.1 * before.mean()
    assert after.max() < before.max() + 0.25
    wrong = (out.refused == "contradicts the data") & ~out.explained
    assert wrong.mean() > 0.6


def test_replacing_widths_as_the_paper_does_follows_a_wrong_grammar():
    true, _, args = case_of(storey("wing"), seed=1, shift_m=0.02, width_error_m=0.1)
    paper = place_rooms(*firm(args), PlacementParams(widths="replace"))
    ours = place_rooms(*firm(args), PlacementParams())
    worse, _ = area_errors(paper.rooms.polygons, true)
    better, _ = area_errors(ours.rooms.polygons, true)
    assert better.mean() < 0.6 * worse.mean()


def test_observed_widths_move_nothing():
    _, _, args = case_of(storey("ring"), seed=2)
    out = place_rooms(*args, PlacementParams(widths="observed"))
    assert shapely.equals(out.rooms.polygons, args[0].polygons).all()


def test_rooms_that_no_rule_explains_keep_their_geometry_and_are_marked():
    _, _, (rooms, walls, observed, layout, grammar) = case_of(storey("wing"), seed=2)
    n = len(layout)
    nothing = replace(
        layout, rules=np.array([""] * n), widths_m=np.full(n, np.nan), spreads_m=np.full(n, np.nan)
    )
    out = place_rooms(rooms, walls, observed, nothing, grammar, PARAMS)
    assert shapely.equals(out.rooms.polygons, rooms.polygons).all()
    assert not out.explained.any()


def test_overlapped_rooms_decoded_as_one_are_kept_as_two():
    """Sec. 7.4: the paper's grammar saw a single room there."""
    true, _, (rooms, walls, observed, layout, grammar) = case_of(storey("wing"), seed=2, shift_m=0)
    classes = [room.class_ for room in storey("wing").rooms]
    big, small = 11, 12
    assert (classes[big], classes[small]) == ("seminar", "storage")
    middle = np.flatnonzero((layout.classes[:-2] == "seminar") & (layout.classes[2:] == "seminar"))[
        0
    ]
    first, last = middle, middle + 2
    one = {f: np.delete(getattr(layout, f), [first + 1, last]) for f in vars(layout)}
    one["to_m"][first], one["to_cuts"][first] = layout.to_m[last], layout.to_cuts[last]
    one["widths_m"][first] = layout.to_m[last] - layout.from_m[first]
    out = place_rooms(rooms, walls, observed, replace(layout, **one), grammar, PARAMS)
    assert len(out) == len(true)
    _, iou = area_errors(out.rooms.polygons, true)
    assert iou.min() > 0.97
    partner = match(ious(list(out.rooms.polygons), true))
    assert out.explained[partner[big]] and not out.explained[partner[small]]


@pytest.mark.parametrize("name", ["ring", "small", "irregular"])
def test_rooms_that_are_no_rectangles_keep_their_corners(name):
    true, _, args = case_of(storey(name, 12), seed=4)
    out = place_rooms(*args, PARAMS)
    partner = match(ious(list(out.rooms.polygons), true))
    corners = shapely.get_num_coordinates(np.array(true, object))
    assert shapely.get_num_coordinates(out.rooms.polygons[partner]).tolist() == corners.tolist()
    assert set(corners) > {5}


def two_corridors(width_m, other_m):
    """Return three rooms between two parallel lines, each said to have its own rule widths."""
    cells = [box(0, 0, 4, 5), box(4.1, 0, 8, 5), box(8.1, 0, 12, 5)]
    rooms, walls = initial_model(cells)
    at, faces = np.array([4.05, 8.05]), np.array([(4.0, 4.1), (8.0, 8.1)])
    back = 12 - faces[::-1, ::-1]
    o = Observations(
        line_ids=np.array(["l0", "l1"]),
        starts=np.array([(0.0, -0.2), (12.0, 5.2)]),
        ends=np.array([(12.0, -0.2), (0.0, 5.2)]),
        end_sigma_m=np.full((2, 2), np.nan),
        end_faces_m=np.full((2, 2, 2), np.nan),
        lines=np.array([0, 0, 1, 1]),
        cut_m=np.concatenate([at, 12 - at[::-1]]),
        sigma_m=np.full(4, 0.05),
        faces_m=np.concatenate([faces, back]),
        scans=np.ones(4, int),
        presence=np.full(4, 0.8),
        interval_lines=np.array([0, 0, 0, 1, 1, 1]),
        from_m=np.array([0, *at, 0, *(12 - at[::-1])]),
        to_m=np.array([*at, 12, *(12 - at[::-1]), 12]),
        rooms=np.array([0, 1, 2, 2, 1, 0]),
        depth_m=np.full(6, 5.2),
    )
    layout = true_layout(o, rooms, cells, ["office"] * 3, 0.1, 0.3)
    widths = np.array([width_m, np.nan, np.nan, np.nan, np.nan, other_m])
    grammar, _ = by_rules(layout, cells, list(zip(o.starts, o.ends, strict=True)))
    return rooms, walls, o, replace(layout, widths_m=widths), grammar


def test_rooms_between_two_corridors_are_placed_by_both_lines_together():
    middle = []
    for widths in ((4.2, 4.2), (4.2, 3.9), (3.9, 4.2)):
        out = place_rooms(*two_corridors(*widths), PARAMS)
        bounds = shapely.bounds(out.rooms.polygons)
        assert bounds[1, 0] > bounds[0, 2] + 0.02
        middle.append((bounds[0, 2] + bounds[1, 0]) / 2)
    both, one, other = middle
    assert both > 4.08
    assert one == pytest.approx(other, abs=1e-3)  # neither line outranks the other
    assert 4.0 < one < both


def row_of(cells, cut_m, faces_m, widths, sigma_m=0.03):
    """Return rooms on one line whose cuts and rules are given."""
    rooms, walls = initial_model(cells)
    length, n = max(cell.bounds[2] for cell in cells) + 0.05, len(cells)
    at = np.array([-0.05, *cut_m, length]) + 0.05
    o = Observations(
        line_ids=np.array(["l0"]),
        starts=np.array([(-0.05, -0.2)]),
        ends=np.array([(length, -0.2)]),
        end_sigma_m=np.full((1, 2), np.nan),
        end_faces_m=np.full((1, 2, 2), np.nan),
        lines=np.zeros(n - 1, int),
        cut_m=at[1:-1],
        sigma_m=np.full(n - 1, sigma_m),
        faces_m=np.array(faces_m) + 0.05,
        scans=np.ones(n - 1, int),
        presence=np.full(n - 1, 0.8),
        interval_lines=np.zeros(n, int),
        from_m=at[:-1],
        to_m=at[1:],
        rooms=np.arange(n),
        depth_m=np.full(n, 5.2),
    )
    layout = true_layout(o, rooms, cells, ["office"] * n, 0.1, 0.3)
    grammar, _ = by_rules(layout, cells, list(zip(o.starts, o.ends, strict=True)))
    grammar = replace(grammar, partition_m=0.1)
    layout = replace(layout, widths_m=np.array(widths), spreads_m=np.full(n, 0.02))
    return rooms, walls, o, layout, grammar


@pytest.mark.parametrize("upper", [np.nan, 4.1], ids=["one face", "both faces"])
def test_a_side_that_the_initial_model_put_elsewhere_goes_to_its_wall(upper):
    cells = [box(0, 0, 4, 5), box(4.4, 0, 8, 5)]  # the wall's upper face is at 4.1
    out = place_rooms(*row_of(cells, [4.05], [(4.0, upper)], [4.1, 4.0]), PlacementParams())
    assert shapely.bounds(out.rooms.polygons)[:, [0, 2]] == pytest.approx(
        np.array([(0, 4), (4.1, 8)]), abs=0.01
    )


def test_a_room_is_not_cut_at_a_wall_that_is_not_probable():
    true, _, args = case_of(storey("wing"), seed=5, missed=0.3)
    rooms, walls, observed, layout, grammar = args
    unsure = replace(layout, from_posteriors=np.full(len(layout), 0.7))
    out = place_rooms(rooms, walls, observed, unsure, grammar, PARAMS)
    assert len(rooms) < len(true)
    assert len(out) == len(rooms)


def test_rooms_are_not_joined_where_a_wall_seen_between_them_may_be_one():
    true, _, args = case_of(storey("wing"), seed=5, spurious=0.3)
    rooms, walls, observed, layout, grammar = args
    assert len(rooms) > len(true)
    for share, expected in ((0.95, len(true)), (0.5, len(rooms))):
        said = replace(layout, undivided=np.full(len(layout), share))
        assert len(place_rooms(rooms, walls, observed, said, grammar, PARAMS)) == expected


@pytest.mark.parametrize("fault", ["missed", "spurious"])
def test_a_grammar_that_hardly_explains_the_rooms_does_not_say_which_there_are(fault):
    true, _, args = case_of(storey("wing"), seed=5, **{fault: 0.3})
    rooms, walls, observed, layout, grammar = args
    per_line = np.array([(layout.line_ids == name).sum() for name in layout.line_ids])
    for gain, expected in ((3.5, len(true)), (2.5, len(rooms))):
        said = replace(layout, gains=gain * per_line)
        assert len(place_rooms(rooms, walls, observed, said, grammar, PARAMS)) == expected


def test_a_room_is_not_cut_at_a_wall_it_has_with_another_that_stands_before_it():
    """An L about a small room: the small one's wall is no wall of the L's."""
    cells = [Polygon([(0, 0), (2, 0), (2, 2), (5, 2), (5, 5), (0, 5)]), box(2.1, 0, 5, 1.9)]
    rooms, walls = initial_model(cells)
    frame = np.array([[0.0, 0.0]]), np.array([[5.0, 0.0]])
    observed = Observations(
        line_ids=np.array(["l0"]), starts=frame[0], ends=frame[1],
        end_sigma_m=np.full((1, 2), np.nan), end_faces_m=np.full((1, 2, 2), np.nan),
        lines=np.zeros(1, int), cut_m=np.array([2.05]), sigma_m=np.array([0.03]),
        faces_m=np.array([[2.0, 2.1]]), scans=np.ones(1, int), presence=np.array([0.99]),
        interval_lines=np.zeros(2, int), from_m=np.array([0, 2.05]), to_m=np.array([2.05, 5]),
        rooms=np.array([0, 1]), depth_m=np.full(2, np.nan),
    )  # fmt: skip
    layout = true_layout(observed, rooms, [box(0, 0, 2, 5), box(2.1, 0, 5, 5)], ["a"] * 2, 0.1, 0.3)
    assert len(layout) == 2 and layout.to_cuts[0] == 0
    rules = tuple(Rule(r, (Part("a", 2.5, 0.5),), 0.5) for r in layout.rules)
    grammar = Grammar("t", "office", "", (), True, ("a",), rules, np.full((2, 2), 0.5), 0.1, 0.02)
    wide = replace(observed, rooms=np.array([0, 0]))
    assert len(place_rooms(rooms, walls, observed, layout, grammar, PARAMS)) == 2
    assert len(place_rooms(rooms, walls, wide, layout, grammar, PARAMS)) == 3


def test_a_tilted_side_is_set_square_on_its_line():
    tilted = Polygon([(0, 0), (3.9, 0), (4.1, 5), (0, 5)])
    args = row_of([tilted, box(4.1, 0, 8, 5)], [4.05], [(4.0, 4.1)], [4.1, 4.0])
    out = place_rooms(*args, PlacementParams())
    assert out.rooms.polygons[0].symmetric_difference(box(0, 0, 4, 5)).area < 0.06


def test_a_wall_thicker_than_partitions_stays_as_thick_as_it_was_seen():
    args = row_of([box(0, 0, 4, 5), box(4.3, 0, 8, 5)], [4.15], [(4.0, 4.3)], [4.2, 3.9])
    bounds = shapely.bounds(place_rooms(*args, PlacementParams()).rooms.polygons)
    assert bounds[1, 0] - bounds[0, 2] == pytest.approx(0.3, abs=1e-6)


layouts = st.sampled_from(["small", "ring", "double_loaded", "open_plan", "irregular"])


@settings(max_examples=10, deadline=None)
@given(
    layouts, st.integers(0, 50), st.integers(0, 50), st.sampled_from([0.02, 0.1, 0.3]),
    st.sampled_from([0.0, 0.5]), st.sampled_from(["fuse", "replace"]),
)  # fmt: skip
def test_whatever_is_wrong_the_plan_is_valid(name, seed, noise, shift_m, error_m, widths):
    _, _, args = case_of(
        storey(name, seed), noise, shift_m, missed=0.3, spurious=0.3, width_error_m=error_m
    )
    out = place_rooms(*args, PlacementParams(widths=widths))
    rooms, initial = out.rooms.polygons, args[0].polygons
    assert shapely.is_valid(rooms).all()
    assert (shapely.get_type_id(rooms) == shapely.GeometryType.POLYGON).all()
    assert (shapely.area(rooms) > 0.5).all()
    assert (overlap_of(rooms) <= overlap_of(initial).sum() + 1e-3).all()
    assert overlap_of(rooms).sum() <= overlap_of(initial).sum() + 0.01


def overlap_of(polygons):
    area = shapely.area(shapely.intersection(polygons[:, None], polygons[None]))
    return np.triu(area, 1)


@settings(max_examples=6, deadline=None)
@given(layouts, st.integers(0, 50), st.integers(0, 50))
def test_neighbours_stay_neighbours(name, seed, noise):
    _, _, args = case_of(storey(name, seed), noise, 0.1)
    out = place_rooms(*args, PARAMS)
    before = shapely.distance(args[0].polygons[:, None], args[0].polygons[None])
    owner = np.array([sources[0] for sources in out.sources])
    after = shapely.distance(out.rooms.polygons[:, None], out.rooms.polygons[None])
    before = before[np.ix_(owner, owner)]
    near = before < PARAMS.thickest_m
    assert (after[near] <= np.maximum(before[near], PARAMS.thickest_m) + 1e-6).all()
