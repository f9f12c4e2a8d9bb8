"""Text clouds: separators, headers, further columns, and errors that name the line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from storage.errors import InputError
from tasks.scans import rows
from tasks.scans.rows import Block, parse
from tasks.scans.text import read_text

POINTS = [[1, 2, 3], [4.5, -5, 6], [7, 8, 1e-3]]


def xyz_of(path):
    return np.concatenate([chunk.xyz for chunk in read_text(path).chunks]).tolist()


def written(tmp_path, text, name="a.xyz"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3\n4.5 -5 6\n7 8 1e-3\n",
        "1 2 3\n4.5 -5 6\n7 8 1e-3",
        "  1   2 3\r\n4.5\t-5 6\r\n\r\n7 8 .001\r\n",
        "1,2,3\n4.5,-5,6\n7,8,1e-3\n",
        "1, 2, 3,\n4.5, -5, 6,\n7, 8, 1e-3,\n",
        "1;2;3\n4.5;-5;6\n7;8;1e-3\n",
        "1,0;2,0;3,0\n4,5;-5,0;6,0\n7,0;8,0;1,0e-3\n",
        "1,0 2,0 3,0\n4,5 -5,0 6,0\n7,0 8,0 1,0e-3\n",
        "x y z\n1 2 3\n4.5 -5 6\n7 8 1e-3\n",
        "# a comment\n//X,Y,Z\n1,2,3\n# another\n4.5,-5,6 # here\n7,8,1e-3\n",
        "3\n1 2 3\n4.5 -5 6\n7 8 1e-3\n",
        "intensity,Z [m],X [m],Y [m]\n9,3,1,2\n9,6,4.5,-5\n9,1e-3,7,8\n",
        "1 2 3 wall\n4.5 -5 6 door\n7 8 1e-3 floor\n",
        "x,y,z,note,r\n1,2,3,,5\n4.5,-5,6,,5\n7,8,1e-3,,5\n",
        "\ufeffx;y;z\n1;2;3\n4.5;-5;6\n7;8;1e-3\n",
    ],
)
def test_all_ways_to_write_three_points(tmp_path, text):
    assert np.allclose(xyz_of(written(tmp_path, text)), POINTS, rtol=1e-6)


@settings(max_examples=60)
@given(st.integers(1, 60), st.integers(3, 6), st.integers(20, 200), st.randoms())
def test_blocks_of_any_size_give_the_same_rows(n, n_columns, size, random):
    import io
    from pathlib import Path

    table = [[random.randint(-9999, 9999) / 16 for _ in range(n_columns)] for _ in range(n)]
    text = "".join(" ".join(map(str, row)) + "\n" for row in table).encode()
    parts = list(rows.blocks(io.BytesIO(text), size=size))
    got = np.concatenate([parse(Path("a"), block, n_columns, (0, 1, 2)) for block in parts])
    assert np.array_equal(got, np.array(table)[:, :3])
    lines = [block.first_line for block in parts]
    counts = [block.text.count(b"\n") for block in parts]
    assert lines == [1 + sum(counts[:i]) for i in range(len(counts))]


def test_a_limit_stops_before_rows_of_another_kind(tmp_path):
    block = Block(b"1 2 3\n\n4 5 6\n3 0 1 2\n", 1)
    assert parse(tmp_path, block, 3, (0, 1, 2), limit=2).tolist() == [[1, 2, 3], [4, 5, 6]]


def test_georeferenced_coordinates_keep_their_digits(tmp_path):
    path = written(tmp_path, "512345.678 5412345.679 251.123\n512346.001 5412345.002 251.5\n")
    assert xyz_of(path)[0] == [512345.678, 5412345.679, 251.123]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("# nothing\nhello\n", "no line with three coordinates"),
        ("hello\nworld\n", "line 2 has 1 columns, expected at least x, y and z"),
        ("1 2\n3 4\n", "line 1 has 2 columns, expected at least x, y and z"),
        ("1 2 3\n4 5 6\n7 8\n", "line 3 has 2 columns, expected 3"),
        ("# c\nx y z\n1 2 3\n4 5 6 7\n2 2\n", "line 4 has 4 columns, expected 3"),
        ("1 2 3\n4 5 6\n7 8 here\n", "line 3 holds no coordinates ('7 8 here')"),
        ("4\n1 2 3\n4 5 6\n", "promises 4 points, it holds 2"),
        (b"1 2 3\n\0\0\0\0\n", "binary data"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=r"a\.xyz: ") as caught:
        read_text(written(tmp_path, text))
    assert message in str(caught.value)
