"""ISPRS wall measures against lengths worked by hand and a dense sample."""

from dataclasses import replace
from hashlib import sha256

import numpy as np
import pytest
import shapely
from shapely import LineString
from shapely.affinity import rotate, translate

from storage.plan import Plan, PlanWall
from storage.plan_geojson import write_plan
from storage.sources import Source
from tasks.evaluation.walls import WallQualityParams, compare_walls, evaluate_walls, faces

DEFAULT = WallQualityParams()


def walls(*lines, thickness_m=None):
    made = (PlanWall(f"w{i}", LineString(line), thickness_m) for i, line in enumerate(lines))
    return Plan("b", "0", walls=tuple(made))


LONG = walls([(0, 0), (10, 0)])


def test_walls_are_complete_correct_and_accurate_beside_themselves():
    quality = compare_walls(LONG, LONG, DEFAULT)
    assert (quality.true_m, quality.found_m) == ([10], [10])
    assert quality.completeness == pytest.approx([1])
    assert quality.correctness == pytest.approx([1])
    assert quality.accuracy_m == pytest.approx([0], abs=1e-9)


def test_half_a_wall_is_half_complete_but_for_the_buffer_at_its_end():
    quality = compare_walls(walls([(0, 0.06), (5, 0.06)]), LONG, DEFAULT)
    # the buffer reaches sqrt(0.1^2 - 0.06^2) beyond the end
    assert quality.completeness == pytest.approx([(5 + 0.08) / 10], abs=1e-4)
    assert quality.correctness == pytest.approx([1])
    assert quality.accuracy_m == pytest.approx([0.06], abs=1e-6)


def test_what_lies_beyond_the_buffer_is_neither_found_nor_measured():
    found = walls([(0, 0.03), (4, 0.03)], [(4.2, 0.2), (10, 0.2)])
    quality = compare_walls(found, LONG, WallQualityParams(buffers_m=(0.02, 0.1, 0.3)))
    assert quality.completeness == pytest.approx(
        [0, (4 + np.sqrt(0.01 - 0.03**2)) / 10, 1], abs=1e-3
    )
    assert quality.correctness == pytest.approx([0, 4 / 9.8, 1], abs=1e-6)
    assert quality.accuracy_m == pytest.approx([np.nan, 0.03, 0.2], abs=1e-4, nan_ok=True)


def test_a_wall_found_twice_is_not_twice_complete():
    quality = compare_walls(walls([(0, 0), (6, 0)], [(0, 0.02), (6, 0.02)]), LONG, DEFAULT)
    assert quality.completeness == pytest.approx([0.61], abs=1e-3)
    assert quality.correctness == pytest.approx([1])


def test_a_wall_has_two_faces_where_its_thickness_is_known():
    thick = walls([(0, 0), (10, 0)], thickness_m=0.4)
    assert sorted(line.coords[0][1] for line in faces(thick.walls)) == pytest.approx([-0.2, 0.2])
    # one face of it was seen
    quality = compare_walls(walls([(0, 0.2), (10, 0.2)]), thick, DEFAULT)
    assert quality.true_m == [20]
    assert quality.completeness == pytest.approx([0.5])
    assert quality.correctness == pytest.approx([1])
    # a centre line is no face
    assert compare_walls(LONG, thick, DEFAULT).completeness == [0]


def test_shares_are_those_of_a_dense_sample():
    rng = np.random.default_rng(1)
    true = walls(*rng.uniform(0, 6, (12, 2, 2)), thickness_m=0.2)
    found = walls(*(np.array(w.line.coords) + rng.normal(0, 0.05, (2, 2)) for w in true.walls[2:]))
    quality = compare_walls(found, true, WallQualityParams(buffers_m=(0.12,), sample_m=0.005))

    def sample(lines):
        return np.concatenate(
            [shapely.line_interpolate_point(f, np.arange(0.0025, f.length, 0.005)) for f in lines]
        )

    ours, theirs = faces(found.walls), faces(true.walls)
    to_found = shapely.distance(sample(theirs), shapely.union_all(ours))
    to_true = shapely.distance(sample(ours), shapely.union_all(theirs))
    assert quality.completeness == pytest.approx([(to_found <= 0.12).mean()], abs=0.005)
    assert quality.correctness == pytest.approx([(to_true <= 0.12).mean()], abs=0.005)
    assert quality.accuracy_m == pytest.approx([np.median(to_found[to_found <= 0.12])], abs=1e-3)
    assert 0.2 < quality.completeness[0] < 0.9


@pytest.mark.parametrize(
    ("found", "truth", "completeness", "correctness"),
    [
        (walls(), LONG, 0, np.nan),
        (LONG, walls(), np.nan, 0),
        (walls(), walls(), np.nan, np.nan),
    ],
    ids=["nothing found", "nothing true", "nothing"],
)
def test_a_share_of_nothing_is_unknown(found, truth, completeness, correctness):
    quality = compare_walls(found, truth, DEFAULT)
    assert quality.completeness == pytest.approx([completeness], nan_ok=True)
    assert quality.correctness == pytest.approx([correctness], nan_ok=True)
    assert np.isnan(quality.accuracy_m).all()


def test_turning_both_plans_changes_nothing_and_turning_one_does():
    def turned(some):
        lines = (translate(rotate(w.line, 33, origin=(0, 0)), 70, -9) for w in some.walls)
        pairs = zip(some.walls, lines, strict=True)
        return replace(some, walls=tuple(replace(wall, line=line) for wall, line in pairs))

    found = walls([(0, 0.03), (4, 0.05)], [(6, 0.1), (10, -0.08)], thickness_m=0.1)
    truth = walls([(0, 0), (10, 0)], thickness_m=0.12)
    a, b = (
        compare_walls(found, truth, DEFAULT),
        compare_walls(turned(found), turned(truth), DEFAULT),
    )
    assert 0 < a.completeness[0] < 1
    for name in ("completeness", "correctness", "accuracy_m"):
        assert getattr(a, name) == pytest.approx(getattr(b, name), abs=2e-3)
    assert compare_walls(turned(found), truth, DEFAULT).completeness == [0]


def test_plans_are_read_from_geojson_and_what_is_simulated_says_so(tmp_path):
    found = replace(walls([(0, 0.06), (5, 0.06)]), simulated=True)
    sources = []
    for name, plan in (("found", found), ("truth", LONG)):
        path = tmp_path / f"{name}.geojson"
        write_plan(plan, path)
        data = path.read_bytes()
        digest = sha256(data).hexdigest()
        sources.append(Source(name=name, path=str(path), sha256=digest, size_bytes=len(data)))
    quality = evaluate_walls(*sources, WallQualityParams())
    assert quality.completeness == pytest.approx([0.508], abs=1e-3)
    assert quality.simulated.all()
