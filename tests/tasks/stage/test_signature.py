"""What a declaration finds out from a function's hints."""

from typing import Any

import pytest
from pydantic import BaseModel

from storage.artifacts import Ref
from storage.planes import PlaneLabels, Planes
from storage.points import PointCloud
from storage.sources import Source
from tasks.params import Params
from tasks.stage.signature import signature_of


class OwnParams(Params):
    x: int = 1


def ref(table: str, sha256: str = "a") -> Ref:
    return Ref(uri="x", sha256=sha256, rows=1, table=table)


def detect(points: PointCloud, params: OwnParams) -> tuple[Planes, PlaneLabels]: ...


def merge(clouds: list[PointCloud], params: OwnParams) -> PointCloud: ...


def load(source: Source) -> PointCloud: ...


def test_stored_things_lists_and_plain_values_are_told_apart():
    detecting, merging = signature_of(detect, "detect"), signature_of(merge, "merge")
    assert [a.kind and a.kind.table for a in detecting.arguments] == ["points", None]
    assert [kind.table for kind in detecting.results] == ["planes", "plane_labels"]
    assert (detecting.several, merging.several) == (True, False)
    assert merging.arguments[0].many


def test_contents_count_and_places_do_not():
    loading = signature_of(load, "load")
    one, two = (
        {"source": Source(name="s", path=path, sha256="abc", size_bytes=1)} for path in ("p", "q")
    )
    assert loading.identity(one) == loading.identity(two) == {"source": "abc"}
    detecting = signature_of(detect, "detect")
    inputs = {"points": ref("points", "abc"), "params": OwnParams()}
    assert detecting.identity(inputs) == {"points": ["abc"], "params": {"x": 1}}


def test_of_several_tables_the_one_of_the_argument_is_taken():
    (points, _) = signature_of(detect, "detect").arguments
    assert points.refs([ref("planes"), ref("points", "b")]) == [ref("points", "b")]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([ref("planes")], "argument 'points': expected one reference to table 'points', got 0"),
        ([ref("points")] * 2, "got 2"),
        (ref("planes"), "got 0"),
    ],
)
def test_a_wrong_reference_failure(given, sentence):
    (points, _) = signature_of(detect, "detect").arguments
    if isinstance(given, Ref):
        sentence = "expected references|got 0"
    with pytest.raises(TypeError, match=sentence):
        points.refs(given)


def test_a_list_takes_references_of_its_table_only():
    (clouds, _) = signature_of(merge, "merge").arguments
    assert clouds.refs([ref("points"), ref("points")]) == [ref("points")] * 2
    with pytest.raises(TypeError, match="argument 'clouds': expected references to table 'points'"):
        clouds.refs([ref("points"), ref("planes")])


class NoContent(BaseModel):
    x: int


def number(n: int) -> PointCloud: ...


def model(thing: NoContent) -> PointCloud: ...


def unknown(points) -> PointCloud: ...


def returns_a_number(points: PointCloud) -> int: ...


def returns_anything(points: PointCloud) -> Any: ...


@pytest.mark.parametrize("fn", [number, model, unknown])
def test_an_argument_that_cannot_be_keyed_is_refused(fn):
    with pytest.raises(
        TypeError, match=r"stage 'it': argument '.*' is .*: expected a stored thing"
    ):
        signature_of(fn, "it")


@pytest.mark.parametrize("fn", [returns_a_number, returns_anything])
def test_a_result_that_cannot_be_stored_is_refused(fn):
    with pytest.raises(TypeError, match=r"stage 'it' returns .*, which is no stored thing"):
        signature_of(fn, "it")
