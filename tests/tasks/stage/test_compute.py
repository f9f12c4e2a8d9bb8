"""What a stage finds on the machine it runs on."""

import shutil
from hashlib import sha256
from pathlib import Path

import pytest

from storage.artifacts import Place, read
from storage.errors import InputError
from storage.points import POINTS, PointCloud
from storage.remote import share
from storage.sources import Source
from tasks.stage.compute import compute
from tasks.stage.signature import signature_of


def as_many_points(source: Source) -> PointCloud:
    """Make as many points as the files of a source say together."""
    import numpy as np

    path = Path(source.path)
    files = sorted(path.rglob("*.txt")) if path.is_dir() else [path]
    count = sum(int(file.read_text()) for file in files)
    return PointCloud(np.zeros((count, 3), np.float32), np.zeros(3))


def points_of(path: Path, store: Path) -> int:
    digest = sha256(path.name.encode()).hexdigest()
    source = Source(name="s", path=str(path), sha256=digest, size_bytes=1)
    place = Place(store=str(store), run="r", building="b", storey="0", scan="s")
    signature = signature_of(as_many_points, "made")
    (ref,) = compute(as_many_points, signature, {"place": place, "source": source})
    return len(read(POINTS, ref, store))


@pytest.mark.parametrize("files", [["scan.txt"], ["scan/a.txt", "scan/deep/b.txt"]])
def test_a_scan_that_another_machine_copied_is_fetched_from_where_it_shares(
    address, tmp_path, files
):
    store = tmp_path / "store"
    copies = store / ".sources" / "0123"
    for file in files:
        (copies / file).parent.mkdir(parents=True, exist_ok=True)
        (copies / file).write_text("5")
        share(store, copies / file)
    scan = copies / Path(files[0]).parts[0]
    assert points_of(scan, store) == 5 * len(files)
    shutil.rmtree(store)  # another machine
    assert points_of(scan, store) == 5 * len(files)


def test_a_scan_that_is_on_another_machine_only_is_named_with_a_remedy(address, tmp_path):
    for path in (tmp_path / "scans" / "a.ply", tmp_path / "store" / ".sources" / "x" / "a.ply"):
        with pytest.raises(InputError, match=r"a\.ply: is not on the machine .* the same path"):
            points_of(path, tmp_path / "store")
