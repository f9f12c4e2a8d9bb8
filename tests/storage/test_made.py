"""What a run has made, found again by its rows."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from storage.artifacts import Place, read, write
from storage.errors import DamagedArtifact
from storage.made import WHOLE, made
from storage.points import POINTS, PointCloud
from storage.stages import StageRow, append


@pytest.fixture
def place(tmp_path):
    return Place(store=str(tmp_path), run="r1", building="b", storey="0")


def cloud(n):
    return PointCloud(np.full((n, 3), 0.5, np.float32), np.zeros(3))


def did(place, stage, *refs, scan=None, outcome="computed"):
    row = StageRow(
        id=f"{stage}-{scan}",
        run=place.run,
        scan=scan,
        stage=stage,
        key="k",
        outcome=outcome,
        wall_s=0.0,
        cpu_s=0.0,
        peak_memory_mb=None,
        rows_in=0,
        rows_out=0,
        points_in=0,
        points_out=0,
        error=None,
        started_at=datetime.now(UTC),
        outputs=tuple(ref.uri for ref in refs),
    )
    append(place, row)


def test_references_are_found_by_table_and_scan(place):
    ours = {scan: write(POINTS, cloud(n), place.of_scan(scan)) for scan, n in (("z", 3), ("a", 5))}
    whole = write(POINTS, cloud(7), place)
    did(place, "clouds", ours["z"], scan="z")
    did(place, "clouds", ours["a"], scan="a", outcome="cached")
    did(place, "merged", whole)
    found = made(place)
    assert found == {"points": {WHOLE: whole, "a": ours["a"], "z": ours["z"]}}
    assert list(found["points"]) == [WHOLE, "a", "z"]
    assert len(read(POINTS, found["points"]["a"], place.store)) == 5


def test_of_one_table_the_last_counts(place):
    raw, decoded = (write(POINTS, cloud(n), place.of_scan("a")) for n in (9, 4))
    did(place, "clouds", raw, scan="a")
    did(place, "decoded", decoded, scan="a")
    assert made(place)["points"]["a"] == decoded


def test_other_runs_do_not_count_and_a_failed_stage_made_nothing(place):
    other = place.model_copy(update={"run": "r2"})
    did(other, "clouds", write(POINTS, cloud(1), place.of_scan("a")), scan="a")
    did(place, "clouds", scan="a", outcome="failed")
    assert made(place) == {}


@pytest.mark.parametrize(
    ("harm", "said"),
    [(Path.unlink, "cannot be read"), (lambda path: path.write_bytes(b"x"), "was changed or cut")],
)
def test_a_missing_or_changed_artifact_is_said(place, harm, said):
    ref = write(POINTS, cloud(2), place)
    did(place, "clouds", ref)
    harm(Path(place.store) / ref.uri)
    with pytest.raises(DamagedArtifact, match=said):
        made(place)
