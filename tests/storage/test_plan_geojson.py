"""The plan's file form: what is written is read again, and nothing wrong is read."""

import copy
import json
import math

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon, box

from storage.errors import InputError, StoreError
from storage.plan import Plan, PlanFurniture, PlanOpening, PlanRoom, PlanWall
from storage.plan_geojson import from_geojson, read_plan, to_geojson, write_plan


def two_rooms() -> Plan:
    return Plan(
        building="ifp",
        storey="4",
        rooms=(
            PlanRoom("r1", box(0, 0, 4, 3), "office", "Büro 4.01", 0.0, 2.8, "r1", 0.75, ("s1",)),
            PlanRoom("r2", box(4.2, 0, 8, 3).difference(box(5, 1, 6, 2))),
        ),
        walls=(PlanWall("w1", LineString([(4.1, 0), (4.1, 3)]), 0.2, 0.0, 2.8, ("r1", "r2")),),
        doors=(
            PlanOpening(
                "d1", LineString([(4.1, 1), (4.1, 1.9)]), 0.0, 2.05, "w1", 0.9, "open", ("r1", "r2")
            ),
        ),
        windows=(PlanOpening("n1", LineString([(4.1, 2), (4.1, 2.5)]), 0.9, 2.2, "w1"),),
        furniture=(PlanFurniture("f1", box(1, 1, 2, 2), "table", 0.0, 0.74, "r1", 0.5),),
        simulated=True,
        notes=("one scan was skipped",),
    )


def test_a_plan_comes_back_as_it_was_written(tmp_path):
    write_plan(two_rooms(), tmp_path / "plan.geojson")
    assert_same(read_plan(tmp_path / "plan.geojson"), two_rooms())


def test_an_empty_plan_comes_back_empty(tmp_path):
    write_plan(Plan("b", "0"), tmp_path / "plan.geojson")
    assert_same(read_plan(tmp_path / "plan.geojson"), Plan("b", "0"))


def test_the_same_plan_gives_the_same_bytes_and_no_temporary_stays(tmp_path):
    for name in ("a.geojson", "b.geojson"):
        write_plan(two_rooms(), tmp_path / name)
    write_plan(read_plan(tmp_path / "a.geojson"), tmp_path / "c.geojson")
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files] == ["a.geojson", "b.geojson", "c.geojson"]
    assert len({file.read_bytes() for file in files}) == 1


def test_unknown_values_are_null_and_derived_ones_follow_from_the_geometry():
    features = {f["id"]: f["properties"] for f in to_geojson(two_rooms())["features"]}
    assert features["r2"]["name"] is None and features["r2"]["posterior"] is None
    assert features["r2"]["area_m2"] == pytest.approx(3.8 * 3 - 1)
    assert features["d1"]["width_m"] == pytest.approx(0.9)
    assert "state" not in features["n1"] and "rooms" not in features["n1"]


@settings(max_examples=50, deadline=None)
@given(
    centre=st.tuples(*2 * [st.floats(-1e4, 1e4)]),
    radii=st.lists(st.floats(0.5, 20), min_size=3, max_size=12),
    floor=st.none() | st.floats(-50, 50),
)
def test_any_star_shaped_room_survives_to_a_tenth_of_a_millimetre(centre, radii, floor):
    steps = [2 * math.pi * i / len(radii) for i in range(len(radii))]
    ring = [
        (centre[0] + r * math.cos(a), centre[1] + r * math.sin(a))
        for r, a in zip(radii, steps, strict=True)
    ]
    plan = Plan("b", "0", rooms=(PlanRoom("r", Polygon(ring), floor_m=floor),))
    once = to_geojson(plan)
    again = from_geojson(once, "memory")
    assert to_geojson(again) == once
    assert shapely.hausdorff_distance(again.rooms[0].polygon, Polygon(ring)) < 1e-4


REJECTED = [
    ("r1", ("properties", "kind"), "hall", "'kind' is \"hall\""),
    ("r1", ("properties", "floor_m"), 3.0, "above 'ceiling_m'"),
    ("r1", ("properties", "floor_m"), math.nan, "'floor_m' is NaN"),
    ("r1", ("properties", "floor_m"), "0", "'floor_m' is \"0\""),
    ("r1", ("properties", "posterior"), 1.5, "from 0 to 1"),
    ("r1", ("properties", "area_m2"), 20, "the geometry gives 12"),
    ("r1", ("properties", "scans"), "s1", "expected a list"),
    ("r1", ("properties", "scans"), [1], "a list of texts"),
    ("r1", ("properties", "name"), 401, "expected a text"),
    ("r1", ("geometry",), None, "JSON object"),
    ("r1", ("geometry", "type"), "LineString", "expected Polygon"),
    ("r1", ("geometry", "coordinates"), [], "no ring"),
    ("r1", ("geometry", "coordinates"), [[[0, 0], [1, 0], [0, 1]]], "4 positions"),
    ("r1", ("geometry", "coordinates"), [[[0, 0], [1, 0], [1, 1], [0, 1]]], "open ring"),
    ("r1", ("geometry", "coordinates", 0, 0), [math.nan, 0], "two finite numbers"),
    ("r1", ("geometry", "coordinates", 0, 1), [1, 2, 3], "x and y in metres"),
    (
        "r1",
        ("geometry", "coordinates"),
        [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]],
        "no simple polygon",
    ),
    ("w1", ("properties", "thickness_m"), -0.1, "of 0 or more"),
    ("w1", ("properties", "rooms"), ["r1", "r9"], 'names "r9"'),
    ("w1", ("properties", "rooms"), ["r1", "r1"], "each room once"),
    ("w1", ("geometry", "coordinates"), [[1, 1], [1, 1]], "no length"),
    ("d1", ("properties", "wall"), "w9", 'names "w9", and no wall'),
    ("d1", ("properties", "state"), "locked", "open, ajar, shut, unknown"),
    ("d1", ("properties", "width_m"), 1.2, "the geometry gives 0.9"),
    ("n1", ("properties", "wall"), "r1", "no wall"),
    ("f1", ("properties", "room"), "w1", "no room"),
    ("f1", ("properties", "class"), "sofa", "table, chair, other"),
    ("f1", ("properties", "confidence"), -0.5, "from 0 to 1"),
]


@pytest.mark.parametrize(("id_", "place", "value", "message"), REJECTED)
def test_what_is_wrong_is_named_with_file_and_feature_failure(id_, place, value, message):
    document = copy.deepcopy(to_geojson(two_rooms()))
    target = next(f for f in document["features"] if f["id"] == id_)
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    with pytest.raises(InputError) as caught:
        from_geojson(document, "lost.geojson")
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"lost.geojson: feature '{id_}'")


FIELDS = [(f["id"], name) for f in to_geojson(two_rooms())["features"] for name in f["properties"]]


@pytest.mark.parametrize(("id_", "name"), FIELDS)
def test_a_missing_property_is_named_failure(id_, name):
    document = to_geojson(two_rooms())
    del next(f for f in document["features"] if f["id"] == id_)["properties"][name]
    with pytest.raises(InputError, match=f"'{id_}'.* '{name}' is missing; add it"):
        from_geojson(document, "lost.geojson")


@pytest.mark.parametrize("name", ["type", "building", "storey", "simulated", "notes", "features"])
def test_a_missing_top_member_is_named_failure(name):
    document = to_geojson(two_rooms())
    del document[name]
    with pytest.raises(InputError, match=f"'{name}' is missing"):
        from_geojson(document, "lost.geojson")


def test_an_id_used_twice_is_refused_failure():
    document = to_geojson(two_rooms())
    document["features"][1]["id"] = "r1"
    with pytest.raises(InputError, match="feature 'r1': 'id' is taken"):
        from_geojson(document, "lost.geojson")


def test_a_plan_that_could_not_be_read_back_is_not_written_failure(tmp_path):
    path = tmp_path / "plan.geojson"
    write_plan(two_rooms(), path)
    before = path.read_bytes()
    bad = Plan("b", "0", furniture=(PlanFurniture("f", box(0, 0, 1, 1), room="nowhere"),))
    with pytest.raises(InputError, match="nowhere"):
        write_plan(bad, path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("text", ["{", '"plan"', "[]", '{"type": "Feature"}', "\ud800"])
def test_a_file_that_is_no_plan_is_refused_failure(tmp_path, text):
    path = tmp_path / "plan.geojson"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(InputError, match=r"plan\.geojson: "):
        read_plan(path)


def test_a_file_that_is_not_there_is_named_failure(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_plan(tmp_path / "plan.geojson")


def test_a_folder_that_cannot_be_made_is_a_store_error_failure(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot write the plan"):
        write_plan(two_rooms(), tmp_path / "file" / "plan.geojson")


def test_nan_in_the_file_is_named_at_its_feature_failure(tmp_path):
    path = tmp_path / "plan.geojson"
    document = to_geojson(two_rooms())
    document["features"][0]["properties"]["floor_m"] = math.nan
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="'r1': 'floor_m' is NaN"):
        read_plan(path)


def assert_same(found: Plan, expected: Plan) -> None:
    assert to_geojson(found) == to_geojson(expected)
    for name in ("rooms", "walls", "doors", "windows", "furniture"):
        for a, b in zip(getattr(found, name), getattr(expected, name), strict=True):
            for field, value in vars(b).items():
                if isinstance(value, shapely.Geometry):
                    assert getattr(a, field).normalize().equals_exact(value.normalize(), 1e-4)
                else:
                    assert getattr(a, field) == value
