"""References, and the tables behind them."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from storage.artifacts import Place, check_name, is_sound, kind_of, read, replace_table, write
from storage.errors import DamagedArtifact, StoreError
from storage.points import POINTS, PointCloud


@pytest.fixture
def place(tmp_path):
    return Place(store=str(tmp_path / "store"), run="r", building="b", storey="01", scan="s")


@pytest.fixture
def cloud():
    return PointCloud(np.array([[0.1, 0.2, 0.3], [1, 2, 3]], np.float32), np.zeros(3))


def test_what_is_written_is_read_back(place, cloud):
    ref = write(POINTS, cloud, place)
    assert (ref.rows, ref.table) == (2, "points")
    assert ref.uri == f"points/building=b/storey=01/scan=s/{ref.sha256[:24]}.parquet"
    np.testing.assert_allclose(read(POINTS, ref, place.store).xyz, cloud.xyz, atol=5e-4)


def test_equal_content_is_one_artifact(place, cloud):
    assert write(POINTS, cloud, place) == write(POINTS, cloud, place)
    assert len(list(Path(place.store).rglob("*.parquet"))) == 1


def test_a_reference_is_good_after_its_store_was_moved(place, cloud, tmp_path):
    ref = write(POINTS, cloud, place)
    moved = shutil.move(place.store, tmp_path / "elsewhere")
    assert len(read(POINTS, ref, moved)) == 2


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: os.truncate(path, 50)])
def test_a_missing_or_cut_artifact_is_not_read(place, cloud, harm):
    ref = write(POINTS, cloud, place)
    harm(Path(place.store) / ref.uri)
    assert not is_sound(ref, place.store)
    with pytest.raises(DamagedArtifact, match="run again, it is remade"):
        read(POINTS, ref, place.store)


def test_a_store_below_a_file_is_said_to_be_unwritable(tmp_path, cloud):
    (tmp_path / "file").write_text("")
    place = Place(store=str(tmp_path / "file" / "store"), run="r", building="b", storey="0")
    with pytest.raises(StoreError, match=r"cannot write there .*Not a directory.*--store"):
        write(POINTS, cloud, place)


def test_nothing_is_left_of_a_write_that_failed(place, cloud):
    target = Path(place.store) / "taken"
    (target / "by a folder").mkdir(parents=True)
    with pytest.raises(StoreError):
        replace_table(target, POINTS.to_table(cloud))
    assert [path.name for path in Path(place.store).iterdir()] == ["taken"]


@pytest.mark.parametrize("name", ["0", "level_2", "B-1.north"])
def test_a_usable_name(name):
    assert check_name(name) == name


@pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "-x", "a..b", "a b", "ä"])
def test_a_usable_name_failure(name):
    with pytest.raises(ValueError, match="is no usable name"):
        check_name(name)
    with pytest.raises(ValidationError):
        Place(store="s", run="r", building=name, storey="0")


def test_only_stored_things_have_a_kind():
    assert kind_of(PointCloud) is POINTS
    assert kind_of(int) is None
