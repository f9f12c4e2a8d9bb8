"""A stream as an artifact: one row, its bytes untouched."""

import pytest

from storage import artifacts
from storage.artifacts import Place, kind_of
from storage.streams import Stream

VALUES = {
    "some": Stream(bytes(range(256)) * 40, "low", 0.01, 2**40, 7),
    "none": Stream(b"", "other", 1 / 3, 0, 0),
}
every_value = pytest.mark.parametrize("value", VALUES.values(), ids=VALUES)
KIND = kind_of(Stream)


@every_value
def test_a_stream_comes_back_from_its_table_and_its_file(value, tmp_path):
    assert KIND.from_table(KIND.to_table(value)) == value
    place = Place(store=str(tmp_path), run="r", building="b", storey="0", scan="s")
    ref = artifacts.write(KIND, value, place)
    assert ref.rows == 1 and ref.table == "streams"
    assert artifacts.read(KIND, ref, tmp_path) == value
    assert artifacts.write(KIND, value, place) == ref


@every_value
def test_the_table_tells_what_goes_on_the_air(value):
    table = KIND.to_table(value)
    assert table.schema.equals(KIND.schema)
    assert table["bytes"].to_pylist() == [len(value.data)]
    for field in table.schema:
        assert field.metadata[b"about"] and not field.nullable
