"""Point labels read in each form, plans derived from them, and points against a found plan."""

import json
from dataclasses import replace

import numpy as np
import open3d
import pytest
import shapely
from shapely import LineString, Polygon, box
from shapely.affinity import rotate, translate

from storage.artifacts import Place, read, write
from storage.errors import InputError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from storage.point_quality import POINT_QUALITY, from_table, to_table
from tasks.evaluation.detections import EvaluationParams, detect
from tasks.evaluation.label_files import ROLES, LabelledPoints, label_files, read_labels
from tasks.evaluation.labels import LabelParams, outline_of, plan_from_labels
from tasks.evaluation.points import PointQualityParams, compare_points
from tasks.simulation.mesh import storey_mesh

DEFAULT = LabelParams()
CLASSES = {"1": "floor", "2": "ceiling", "3": "wall", "4": "door", "5": "table", "9": "clutter"}


def labelled(*parts, rooms=("r",), simulated=False):
    """Points of (role, object, room, xyz)."""
    return LabelledPoints(
        building="b",
        storey="0",
        simulated=simulated,
        xyz=np.concatenate([np.empty((0, 3)), *(np.atleast_2d(p[3]) for p in parts)]),
        roles=np.concatenate(
            [np.empty(0, np.int8)]
            + [np.full(len(p[3]), ROLES.index(p[0]) if p[0] else -1, np.int8) for p in parts]
        ),
        objects=np.concatenate(
            [np.empty(0, np.int64)] + [np.full(len(p[3]), p[1]) for p in parts]
        ).astype(np.int64),
        rooms=np.concatenate(
            [np.empty(0, np.int64)] + [np.full(len(p[3]), p[2]) for p in parts]
        ).astype(np.int64),
        room_names=rooms,
        room_classes=(None,) * len(rooms),
    )


def grid(polygon, z, step=0.05):
    """Points over an area, its edges included."""
    x0, y0, x1, y1 = polygon.bounds
    nx, ny = round((x1 - x0) / step) + 1, round((y1 - y0) / step) + 1
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(x0, x1, nx), np.linspace(y0, y1, ny)))
    inside = shapely.intersects_xy(polygon.buffer(1e-9), x, y)
    return np.column_stack([x[inside], y[inside], np.full(inside.sum(), z)])


def upright(start, stop, low, high, step=0.05):
    """Points on a vertical rectangle, its edges included."""
    start, stop = np.array(start, float), np.array(stop, float)
    length = np.hypot(*(stop - start))
    t, z = np.meshgrid(
        np.linspace(0, 1, round(length / step) + 1),
        np.linspace(low, high, round((high - low) / step) + 1),
    )
    return np.column_stack([start + t.reshape(-1, 1) * (stop - start), z.ravel()])


# --- forms ---------------------------------------------------------------------------------------

ROWS = [(0.5, 1.0, 0.25, 1, 0, 7), (2.0, 3.0, 4.0, 5, 12, 7), (-1.5, 0.0, 2.5, 9, 3, 40000)]
NAMES = ("x", "y", "z", "label", "instance", "room")


def ply(form, names=NAMES, rows=ROWS):
    types = ("double", "float", "double", "uchar", "int", "ushort")
    head = [f"ply\nformat {form} 1.0\ncomment made by hand\nelement vertex {len(rows)}"]
    head += [f"property {t} {n}" for t, n in zip(types, names, strict=True)]
    head += ["element face 0", "property list uchar int vertex_indices", "end_header\n"]
    if form == "ascii":
        return ("\n".join(head) + "".join(" ".join(map(str, r)) + "\n" for r in rows)).encode()
    order = "<" if "little" in form else ">"
    kinds = ("f8", "f4", "f8", "u1", "i4", "u2")
    row = np.dtype([(n, order + k) for n, k in zip(names, kinds, strict=True)])
    return "\n".join(head).encode() + np.array(rows, row).tobytes()


def pcd(form):
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z label instance room\nSIZE 8 4 8 1 4 2\n"
        f"TYPE F F F U I U\nCOUNT 1 1 1 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA {form}\n"
    ).encode()
    body = ply("ascii" if form == "ascii" else "binary_little_endian")
    return head + body[body.index(b"end_header\n") + 11 :]


def manifest(folder, points, **changed):
    given = {"building": "b", "storey": "1", "points": points, "classes": CLASSES}
    path = folder / "labels.json"
    path.write_text(json.dumps(given | changed))
    return path


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.ply", ply("ascii")),
        ("a.ply", ply("binary_little_endian")),
        ("a.ply", ply("binary_big_endian")),
        ("a.pcd", pcd("ascii")),
        ("a.pcd", pcd("binary")),
    ],
)
def test_points_labels_objects_and_rooms_are_read_from_each_form(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    made = read_labels(manifest(tmp_path, [name], room_property="room"))
    np.testing.assert_array_equal(made.xyz, [row[:3] for row in ROWS])
    assert [ROLES[i] if i >= 0 else "" for i in made.roles] == ["floor", "table", ""]
    assert made.objects.tolist() == [0, 12, 3]
    assert made.room_names == ("7", "40000")
    assert made.rooms.tolist() == [0, 0, 1]


def test_without_a_room_property_each_file_is_a_room_and_toml_says_the_same(tmp_path):
    for name in ("hall.ply", "office.ply"):
        (tmp_path / name).write_bytes(ply("binary_little_endian"))
    path = tmp_path / "labels.toml"
    classes = "\n".join(f'{k} = "{v}"' for k, v in CLASSES.items())
    path.write_text(
        'building = "b"\nstorey = "1"\nsimulated = true\npoints = ["hall.ply", "office.ply"]\n'
        f"[classes]\n{classes}\n"
    )
    made = read_labels(path)
    assert made.room_names == ("hall", "office")
    assert made.rooms.tolist() == [0, 0, 0, 1, 1, 1]
    assert made.simulated
    assert label_files(path) == (path, tmp_path / "hall.ply", tmp_path / "office.ply")


def test_a_property_of_another_name_is_used_if_it_is_named(tmp_path):
    names = ("x", "y", "z", "semantic", "thing", "room")
    (tmp_path / "a.ply").write_bytes(ply("ascii", names))
    with pytest.raises(InputError, match=r"no property 'label' or 'class'; it has x, y, z, sem"):
        read_labels(manifest(tmp_path, ["a.ply"]))
    made = read_labels(manifest(tmp_path, ["a.ply"], class_property="semantic"))
    assert made.objects.tolist() == [-1, -1, -1]
    asked = manifest(tmp_path, ["a.ply"], class_property="semantic", object_property="thing")
    assert read_labels(asked).objects.tolist() == [0, 12, 3]


@pytest.mark.parametrize(
    ("changed", "wrong"),
    [
        ({"classes": {"1": "floor"}}, "does not say what 5 in a.ply is"),
        ({"classes": {"1": "lift"}}, "classes.1"),
        ({"storey": ""}, "storey"),
        ({"points": []}, "points"),
        ({"clases": {}}, "clases"),
        ({"points": ["b.ply"]}, "b.ply: cannot be read"),
        ({"points": ["labels.json"]}, "neither PLY nor PCD"),
        ({"class_property": "y", "classes": CLASSES}, "'classes' does not say"),
        ({"object_property": "x"}, "holds fractions"),
    ],
)
def test_a_file_that_names_labels_wrongly_is_refused(tmp_path, changed, wrong):
    (tmp_path / "a.ply").write_bytes(ply("ascii"))
    with pytest.raises(InputError, match=wrong):
        read_labels(manifest(tmp_path, **{"points": ["a.ply"]} | changed))


LISTS = b"element vertex 1\nproperty float x\nproperty list uchar int y\nend_header\n"


@pytest.mark.parametrize(
    ("name", "data", "wrong"),
    [
        ("a.ply", ply("binary_little_endian")[:-1], "promises 3 rows, the file holds 2"),
        ("a.ply", ply("ascii")[:-40], "holds 2|no table"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\n", "no line 'end_header'"),
        ("a.ply", b"ply\nformat odd 1.0\nelement vertex 1\nend_header\n", "format"),
        ("a.ply", b"ply\nformat ascii 1.0\n" + LISTS, "list uchar int y"),
        ("a.ply", ply("ascii").replace(b"0.25", b"quarter"), "no table of numbers"),
        ("a.ply", ply("ascii").replace(b"0.25", b"nan"), "not finite"),
        ("a.pcd", pcd("binary")[:-1], "promises 3 rows, the file holds 2"),
        ("a.pcd", pcd("binary").replace(b"DATA binary", b"DATA binary_compressed"), "compressed"),
        ("a.pcd", pcd("ascii").replace(b"COUNT 1 1", b"COUNT 1 3"), "COUNT"),
        ("a.pcd", pcd("ascii").replace(b"SIZE 8 4", b"SIZE 7 4"), "do not agree"),
        ("a.pcd", pcd("ascii").replace(b"TYPE", b"TIPE"), "no line 'TYPE'"),
    ],
)
def test_a_damaged_cloud_is_refused_by_name(tmp_path, name, data, wrong):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=wrong) as caught:
        read_labels(manifest(tmp_path, [name]))
    assert caught.value.path.endswith(name)


def s3dis(folder, rooms):
    for room, objects in rooms.items():
        (folder / room / "Annotations").mkdir(parents=True)
        for name, xyz in objects.items():
            rows = np.column_stack([xyz, np.full((len(xyz), 3), 128)])
            np.savetxt(folder / room / "Annotations" / f"{name}.txt", rows, fmt="%.3f")
    return folder


def test_the_s3dis_layout_gives_classes_objects_and_rooms_by_its_names(tmp_path):
    area = s3dis(
        tmp_path / "Area_9",
        {
            "office_12": {
                "floor_1": grid(box(0, 0, 3, 2), 0.0),
                "chair_1": grid(box(1, 1, 1.4, 1.4), 0.45),
                "chair_2": grid(box(2, 1, 2.4, 1.4), 0.45),
                "sofa_1": grid(box(0, 0, 1, 0.5), 0.4),
                "clutter_1": grid(box(0, 1, 1, 1.5), 0.8),
            },
            "hallway_1": {"ceiling_1": grid(box(3, 0, 9, 2), 2.6)},
        },
    )
    made = read_labels(area)
    assert made.room_names == ("hallway_1", "office_12")
    assert made.room_classes == ("hallway", "office")
    assert made.building == "Area_9"
    assert len(label_files(area)) == 6
    plan = plan_from_labels(made, DEFAULT)
    assert {room.name: room.class_ for room in plan.rooms} == {
        "hallway_1": "hallway",
        "office_12": "office",
    }
    assert [room.polygon.area for room in plan.rooms] == pytest.approx([12, 6])
    assert [(r.floor_m, r.ceiling_m) for r in plan.rooms] == [(None, 2.6), (0.0, None)]
    assert sorted(piece.class_ for piece in plan.furniture) == ["chair", "chair", "other"]
    one = read_labels(area / "office_12")
    assert one.room_names == ("office_12",)


def test_what_is_not_in_s3dis_layout_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no folder with 'Annotations'"):
        read_labels(tmp_path)
    area = s3dis(tmp_path / "a", {"office_1": {"unicorn_1": np.zeros((1, 3))}})
    with pytest.raises(InputError, match="'unicorn' is no class of S3DIS"):
        read_labels(area)
    (area / "office_1" / "Annotations" / "unicorn_1.txt").rename(
        area / "office_1" / "Annotations" / "wall_1.txt"
    )
    (area / "office_1" / "Annotations" / "wall_1.txt").write_text("1 2 3 4 5 6\n1 2\x103 3\n")
    with pytest.raises(InputError, match=r"wall_1.txt: is no table of x y z"):
        read_labels(area)


# --- plans ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0, 28])
def test_an_outline_is_the_room_with_its_alcove_its_column_and_no_stray_points(turn):
    room = Polygon([(0, 0), (6, 0), (6, 4), (4, 4), (4, 5), (2, 5), (2, 4), (0, 4)])
    room = room.difference(box(2.5, 1.5, 3.5, 2.5))
    xy = grid(room, 0.0, 0.04)[:, :2]
    stray = grid(box(8, 1, 8.5, 1.5), 0.0)[:, :2]  # the floor behind an open door
    xy = np.concatenate([xy, stray])
    turned = rotate(room, turn, origin=(0, 0))
    away = np.radians(turn)
    matrix = np.array([[np.cos(away), np.sin(away)], [-np.sin(away), np.cos(away)]])
    outline = outline_of(xy @ matrix, DEFAULT)
    assert outline.symmetric_difference(turned).area < 0.01 * turned.area
    assert len(outline.interiors) == 1


def test_what_spans_no_area_has_no_outline():
    for xy in (np.empty((0, 2)), np.zeros((9, 2)), np.column_stack([np.arange(9.0), np.zeros(9)])):
        assert outline_of(xy, DEFAULT) is None


def test_a_ceiling_fills_what_furniture_hides_of_the_floor():
    hidden = box(0, 0, 4, 3).difference(box(0, 0, 4, 0.8))
    alone = labelled(("floor", 0, 0, grid(hidden, 0.0)))
    both = labelled(
        ("floor", 0, 0, grid(hidden, 0.0)), ("ceiling", 0, 0, grid(box(0, 0, 4, 3), 2.5))
    )
    (cut,), (whole,) = (plan_from_labels(p, DEFAULT).rooms for p in (alone, both))
    assert cut.polygon.area == pytest.approx(4 * 2.2, rel=1e-3)
    assert whole.polygon.area == pytest.approx(12, rel=1e-3)
    assert (whole.floor_m, whole.ceiling_m) == (0.0, 2.5)


def test_a_door_lies_on_its_wall_and_furniture_in_its_box():
    table = rotate(box(1, 1, 2.6, 1.8), 25)
    plan = plan_from_labels(
        labelled(
            ("wall", 1, 0, upright((0, 0), (5, 0), 0, 2.5)),
            ("wall", 2, 0, upright((0, 0), (0, 3), 0, 2.5)),
            # the other room's face, to which the leaf that is recessed by 8 cm is nearer
            ("wall", 1, 1, upright((0, -0.1), (4, -0.1), 0, 2.5)),
            ("door", 1, 0, upright((1, -0.08), (1.9, -0.08), 0, 2.05)),
            ("window", 1, 0, upright((0.03, 1), (0.03, 2.2), 0.9, 2.1)),
            ("table", 7, 0, grid(table, 0.74, 0.02)),
            rooms=("r", "s"),
        ),
        DEFAULT,
    )
    walls = {wall.id: wall for wall in plan.walls}
    assert sorted(wall.line.length for wall in walls.values()) == pytest.approx([3, 4, 5])
    assert all(wall.thickness_m is None for wall in walls.values())
    (door,), (window,), (piece,) = plan.doors, plan.windows, plan.furniture
    assert walls[door.wall].line.length == pytest.approx(5)
    assert door.line.hausdorff_distance(LineString([(1, 0), (1.9, 0)])) < 1e-6
    assert (door.sill_m, door.head_m, door.state, door.rooms) == (0.0, 2.05, "unknown", ())
    assert walls[window.wall].line.length == pytest.approx(3)
    assert window.line.length == pytest.approx(1.2)
    assert (window.sill_m, window.head_m, window.state) == (0.9, 2.1, None)
    assert piece.footprint.symmetric_difference(table).area < 0.03 * table.area
    assert "derived from point labels" in plan.notes[0]


def test_what_the_labels_do_not_tell_is_left_out_and_told():
    bent = np.concatenate([upright((0, 0), (2, 0), 0, 2.5), upright((2, 0), (2, 2), 0, 2.5)])
    plan = plan_from_labels(
        labelled(
            ("wall", 1, 0, bent),
            ("chair", -1, 0, grid(box(0, 0, 1, 1), 0.4)),
            ("table", 1, 0, np.zeros((3, 3))),
        ),
        DEFAULT,
    )
    assert plan.rooms == plan.walls == plan.furniture == ()
    notes = " ".join(plan.notes)
    for told in ("r has no floor", "from flat", "points of class chair name no object", "too few"):
        assert told in notes
    nothing = plan_from_labels(labelled(rooms=()), DEFAULT)
    assert nothing.rooms == nothing.doors == ()


# --- a simulated scan with the object of every hit ------------------------------------------------


def house():
    rooms = (
        PlanRoom("a", box(0, 0, 5, 4), "office", None, 0.0, 2.6),
        PlanRoom("b", box(5.1, 0, 9, 4), "office", None, 0.0, 2.6),
    )
    lines = {
        "between": [(5.05, 0), (5.05, 4)],
        "south": [(-0.1, -0.1), (9.1, -0.1)],
        "north": [(-0.1, 4.1), (9.1, 4.1)],
        "west": [(-0.1, -0.1), (-0.1, 4.1)],
        "east": [(9.1, -0.1), (9.1, 4.1)],
    }
    walls = tuple(
        PlanWall(name, LineString(line), 0.1 if name == "between" else 0.2, 0.0, 2.6)
        for name, line in lines.items()
    )
    door = PlanOpening(
        "d", LineString([(5.05, 1.2), (5.05, 2.1)]), 0.0, 2.0, "between", None, "shut", ("a", "b")
    )
    pieces = (
        PlanFurniture("desk-1", box(1, 3, 2.6, 3.8), "table", 0.0, 0.74, "a"),
        PlanFurniture("table-1", rotate(box(6.5, 1.5, 7.9, 2.3), 20), "table", 0.0, 0.74, "b"),
        PlanFurniture("cabinet-1", box(0, 0, 0.45, 1.2), "other", 0.0, 1.4, "a"),
    )
    return Plan("b", "0", rooms, walls, (door,), (), pieces, simulated=True)


@pytest.fixture(scope="module")
def scanned():
    """Rays from six places of each room; the object that each of them hits first is its label."""
    plan = house()
    scene = open3d.t.geometry.RaycastingScene()
    parts = [
        ("room", replace(plan, walls=(), doors=(), furniture=())),
        ("wall", replace(plan, rooms=(), doors=(), furniture=())),
        *(
            (piece.class_, replace(plan, walls=(), doors=(), rooms=(), furniture=(piece,)))
            for piece in plan.furniture
        ),
    ]
    for _, part in parts:
        mesh = storey_mesh(part)
        scene.add_triangles(open3d.core.Tensor(mesh.vertices), open3d.core.Tensor(mesh.triangles))
    rng = np.random.default_rng(0)
    made = []
    for room, whole in enumerate(plan.rooms):
        x0, y0, x1, y1 = whole.polygon.bounds
        eyes = np.array([(x, y, 1.5) for x in (x0 + 1, x1 - 1) for y in (y0 + 0.7, 2, y1 - 0.7)])
        rays = rng.normal(size=(120_000, 3))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        eyes = eyes[rng.integers(len(eyes), size=len(rays))]
        hit = scene.cast_rays(open3d.core.Tensor(np.hstack([eyes, rays]).astype(np.float32)))
        depth, geometry = hit["t_hit"].numpy(), hit["geometry_ids"].numpy()
        xyz = eyes + (depth + rng.normal(0, 0.004, len(depth)))[:, None] * rays
        seen = np.isfinite(depth)
        for number, (kind, _) in enumerate(parts):
            of = xyz[seen & (geometry == number)]
            if kind == "room":
                made.append(("floor", 0, room, of[of[:, 2] < 1]))
                made.append(("ceiling", 0, room, of[of[:, 2] > 1]))
            elif kind == "wall":
                # one object a side of the room, and the shut door between the rooms
                gaps = np.abs(np.column_stack([of[:, :2] - (x0, y0), of[:, :2] - (x1, y1)]))
                side = gaps.argmin(axis=1)
                y, z = of[:, 1], of[:, 2]
                doorway = (side == (2 if room == 0 else 0)) & (y > 1.2) & (y < 2.1) & (z < 2.0)
                made.append(("door", 0, room, of[doorway]))
                made += [("wall", k, room, of[(side == k) & ~doorway]) for k in range(4)]
            else:
                made.append((kind, number, room, of))
    return plan, labelled(*(m for m in made if len(m[3])), rooms=("a", "b"), simulated=True)


def test_a_simulated_scan_gives_its_storey_back(scanned):
    plan, points = scanned
    derived = plan_from_labels(points, DEFAULT)
    assert derived.simulated
    for room, true in zip(derived.rooms, plan.rooms, strict=True):
        both = room.polygon.intersection(true.polygon).area
        assert both / room.polygon.union(true.polygon).area > 0.97
        assert room.floor_m == pytest.approx(0.0, abs=0.01)
        assert room.ceiling_m == pytest.approx(2.6, abs=0.01)
    assert len(derived.walls) == 8
    assert [door.line.length for door in derived.doors] == pytest.approx([0.9, 0.9], abs=0.03)
    rows = detect(plan, derived, EvaluationParams())
    for class_, metric, threshold, n in (
        ("room", "iou", 0.5, 2),
        ("furniture", "iou_3d", 0.5, 3),
        ("table", "iou", 0.5, 2),
    ):
        of = (rows.classes == class_) & (rows.metrics == metric) & (rows.thresholds == threshold)
        assert np.sum(of & (rows.true_ids != "") & (rows.found_ids != "")) == n
        assert np.sum(of) == n


# --- points against a plan ------------------------------------------------------------------------


def of(quality, class_, buffer_m=0.05):
    (row,) = np.flatnonzero((quality.classes == class_) & (quality.buffer_m == buffer_m))
    return {name: getattr(quality, name)[row] for name in vars(quality)}


def test_the_true_plan_explains_the_simulated_points_and_a_moved_one_does_not(scanned):
    plan, points = scanned
    good = compare_points(plan, points, PointQualityParams())
    for class_ in ("floor", "ceiling", "wall", "furniture"):
        assert of(good, class_)["completeness"] > 0.99, class_
        assert of(good, class_)["iou"] > 0.85, class_
    assert of(good, "door")["completeness"] > 0.9
    assert good.simulated.all()
    away = replace(
        plan,
        walls=tuple(replace(w, line=translate(w.line, 0.3, 0.3)) for w in plan.walls),
        furniture=(),
    )
    bad = compare_points(away, points, PointQualityParams())
    # what is left of the walls is where they cross the moved ones
    assert of(bad, "wall")["completeness"] < 0.15
    assert of(bad, "furniture")["completeness"] == 0
    assert of(bad, "furniture")["iou"] == 0


def test_half_a_wall_explains_half_of_its_points_and_both_faces_count():
    wall = PlanWall("w", LineString([(0, 0.1), (2, 0.1)]), 0.2, 0.0, 2.0)
    points = labelled(
        ("wall", 1, 0, upright((0.025, 0.001), (3.975, 0.001), 0.025, 3.975)),
        ("wall", 2, 0, upright((0.025, 0.201), (1.975, 0.201), 0.025, 1.975)),
    )
    quality = compare_points(Plan("b", "0", walls=(wall,)), points, PointQualityParams())
    # 80 x 80 and 40 x 40 points 5 cm apart; found: one more row and column within the buffer
    row = of(quality, "wall")
    assert row["true_points"] == 6400 + 1600
    assert row["near_points"] == 41 * 41 + 1600
    assert row["found_points"] == row["matched_points"] == row["near_points"]
    assert row["completeness"] == pytest.approx(row["near_points"] / 8000)
    assert row["iou"] == row["completeness"]
    # a wall whose heights nobody knows stands at any
    tall = replace(wall, base_m=None, top_m=None)
    row = of(compare_points(Plan("b", "0", walls=(tall,)), points, PointQualityParams()), "wall")
    assert row["near_points"] == 41 * 80 + 1600


def test_clutter_on_a_floor_counts_against_its_iou_but_not_its_completeness():
    room = PlanRoom("r", box(0, 0, 2, 2), floor_m=0.0, ceiling_m=2.5)
    floor = grid(box(0.025, 0.025, 1.975, 1.975), 0.01)
    left = floor[:, 0] < 1
    points = labelled(("floor", 0, 0, floor[left]), ("", 0, 0, floor[~left]))
    row = of(compare_points(Plan("b", "0", rooms=(room,)), points, PointQualityParams()), "floor")
    assert (row["true_points"], row["found_points"], row["matched_points"]) == (800, 1600, 800)
    assert (row["completeness"], row["iou"]) == (1.0, 0.5)


def test_a_shut_door_is_no_wall_and_more_points_of_one_place_are_one():
    wall = PlanWall("w", LineString([(0, 0.05), (4, 0.05)]), 0.1, 0.0, 2.5)
    door = PlanOpening("d", LineString([(1, 0.05), (2, 0.05)]), 0.0, 2.0, "w")
    leaf = upright((1.025, 0.0), (1.975, 0.0), 0.025, 1.975)
    plan = Plan("b", "0", walls=(wall,), doors=(door,))
    once = compare_points(plan, labelled(("door", 1, 0, leaf)), PointQualityParams())
    often = compare_points(
        plan, labelled(("door", 1, 0, np.repeat(leaf, 5, axis=0))), PointQualityParams()
    )
    assert of(once, "door")["iou"] == of(once, "door")["completeness"] == 1
    assert of(once, "wall")["found_points"] == 0
    assert of(often, "door")["true_points"] == of(once, "door")["true_points"] == 800


def test_nothing_labelled_and_nothing_found_are_defined_and_rows_are_kept(tmp_path):
    nothing = compare_points(Plan("b", "0"), labelled(rooms=()), PointQualityParams())
    assert np.isnan(nothing.completeness).all()
    assert np.isnan(nothing.iou).all()
    points = labelled(("wall", 1, 0, upright((0, 0), (1, 0), 0, 1)))
    missed = compare_points(Plan("b", "0"), points, PointQualityParams())
    assert of(missed, "wall")["completeness"] == of(missed, "wall")["iou"] == 0
    assert len(missed) == 12
    none = compare_points(Plan("b", "0"), points, PointQualityParams(buffers_m=()))
    assert len(none) == 0
    place = Place(store=str(tmp_path), run="r", building="b", storey="0")
    kept = read(POINT_QUALITY, write(POINT_QUALITY, missed, place), str(tmp_path))
    for a, b in ((missed, kept), (none, from_table(to_table(none)))):
        for name in vars(a):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
