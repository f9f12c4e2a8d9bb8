"""Stores that share an address: two folders and a file system in memory stand for two machines."""

import os
import shutil
from datetime import UTC, datetime
from pathlib import Path

import fsspec
import numpy as np
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from storage import remote as shared
from storage.artifacts import Place, Ref, check, is_sound, read, write
from storage.catalog import Catalog
from storage.errors import DamagedArtifact, StoreError
from storage.mapped_sources import (
    MappedSource,
    MappedSources,
    read_mapped_sources,
    write_mapped_sources,
)
from storage.points import POINTS, PointCloud
from storage.runs import Run, read_runs, recorded
from storage.stages import StageRow, append, of_run

BUILDING, STOREY = "b", "1"
START = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture
def machines(tmp_path: Path, address: str) -> tuple[str, str]:
    """Two stores that share an address."""
    return str(tmp_path / "one"), str(tmp_path / "two")


def place(store: str, run: str = "r") -> Place:
    return Place(store=store, run=run, building=BUILDING, storey=STOREY, scan="s")


def cloud() -> PointCloud:
    xyz = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    return PointCloud(xyz, np.zeros(3))


def stage_row(stage: str = "made", outputs: tuple[str, ...] = ()) -> StageRow:
    return StageRow(
        "id", "r", "s", stage, "key", "computed", 0.1, 0.1, 1.0, 0, 0, 0, 0, None, START, outputs
    )


def a_run() -> Run:
    return Run("r", "map", BUILDING, STOREY, "{}", START)


def test_an_artifact_is_read_where_it_was_not_written(machines: tuple[str, str]) -> None:
    one, two = machines
    ref = write(POINTS, cloud(), place(one))
    assert not Path(two).exists()
    np.testing.assert_allclose(read(POINTS, ref, two).xyz, cloud().xyz, atol=0.00051)
    assert (Path(two) / ref.uri).read_bytes() == (Path(one) / ref.uri).read_bytes()


def test_without_an_address_nothing_is_shared(
    machines: tuple[str, str], address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(shared.REMOTE)
    one, two = machines
    ref = write(POINTS, cloud(), place(one))
    assert fsspec.filesystem("memory").find(address) == []
    with pytest.raises(DamagedArtifact, match="cannot be read"):
        check(ref, two)


def test_an_object_that_was_changed_is_found_out(machines: tuple[str, str], address: str) -> None:
    one, two = machines
    ref = write(POINTS, cloud(), place(one))
    fsspec.filesystem("memory").pipe_file(f"{address}/{ref.uri}", b"planted")
    assert not is_sound(ref, two)
    with pytest.raises(DamagedArtifact, match="changed or cut"):
        read(POINTS, ref, two)


def test_rows_of_runs_and_stages_are_seen_by_the_other(machines: tuple[str, str]) -> None:
    one, two = machines
    run = a_run()
    with recorded(one, run) as record:
        assert [r.state for r in read_runs(two)] == ["running"]
        append(place(one), stage_row("first"))
        assert [row.stage for row in of_run(place(two))] == ["first"]
        append(place(one), stage_row("second"))
        record.end("completed", "")
    assert [r.state for r in read_runs(two, BUILDING)] == ["completed"]
    assert [row.stage for row in of_run(place(two))] == ["first", "second"]


def test_sources_mapped_by_one_are_known_to_the_other_and_back(machines: tuple[str, str]) -> None:
    one, two = machines
    for writer, reader, name in [(one, two, "a"), (two, one, "bb"), (one, two, "ccc")]:
        mapped = MappedSources("r", "", (MappedSource(name, "", ""),))
        write_mapped_sources(writer, BUILDING, STOREY, mapped)
        assert read_mapped_sources(reader, BUILDING, STOREY) == mapped


def test_sql_on_a_new_machine_answers_as_on_the_old_one(machines: tuple[str, str]) -> None:
    one, two = machines
    run = a_run()
    with recorded(one, run) as record:
        ref = write(POINTS, cloud(), place(one))
        append(place(one), stage_row(outputs=(ref.uri,)))
        record.end("completed", "")
    asked = "select building, scan, run, count(*) n from points group by all"
    assert Catalog(two).query(asked).equals(Catalog(one).query(asked))
    assert Catalog(two).query(asked)["n"].to_pylist() == [50]
    assert Catalog(two).query("select count(*) n from points_all")["n"].to_pylist() == [50]


def test_what_did_not_change_is_not_fetched_again(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = machines
    append(place(one), stage_row())
    fetched: list[str] = []
    get = shared.Remote.get
    monkeypatch.setattr(
        shared.Remote, "get", lambda at, name, path: fetched.append(name) or get(at, name, path)
    )
    for _ in range(3):
        of_run(place(two))
        of_run(place(one))
    assert len(fetched) == 1


def test_a_name_that_leads_out_of_the_store_is_not_taken(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = fsspec.filesystem("memory")
    memory.pipe_file("/bucket/out.parquet", b"planted")
    about = memory.info("/bucket/out.parquet")
    planted = {"/bucket/prefix/runs/../../out.parquet": about}
    monkeypatch.setattr(MemoryFileSystem, "find", lambda memory, path, detail: planted)
    shared.refresh(machines[0], "runs")
    assert not list(Path(machines[0]).parent.rglob("out.parquet"))


def test_an_address_that_fails_for_a_while_is_tried_again(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = machines
    monkeypatch.setattr(shared, "PAUSES_S", (0.0, 0.0))
    failing = Failing(monkeypatch, failures=2)
    ref = write(POINTS, cloud(), place(one))
    assert failing.calls == 3
    assert is_sound(ref, two)


def test_an_address_that_fails_for_good_is_named_with_the_remedy(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared, "PAUSES_S", (0.0, 0.0))
    Failing(monkeypatch, failures=100)
    with pytest.raises(StoreError, match=r"memory://bucket/prefix.*503.*run again"):
        write(POINTS, cloud(), place(machines[0]))
    ref = next(Path(machines[0]).rglob("*.parquet"))
    assert ref.stat().st_size > 0  # nothing is lost here


def test_an_address_that_is_gone_is_left_alone_for_a_while(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared, "PAUSES_S", ())
    failing = Failing(monkeypatch, failures=1)
    for _ in range(3):
        with pytest.raises(StoreError):
            write(POINTS, cloud(), place(machines[0]))
    assert failing.calls == 1
    now = shared.time.monotonic()
    monkeypatch.setattr(shared.time, "monotonic", lambda: now + shared.GONE_S + 1)
    assert is_sound(write(POINTS, cloud(), place(machines[0])), machines[1])


def test_a_refusal_is_not_tried_again(
    machines: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    failing = Failing(monkeypatch, failures=100, error=PermissionError("403"))
    with pytest.raises(StoreError, match="403"):
        write(POINTS, cloud(), place(machines[0]))
    assert failing.calls == 1


def test_a_file_we_wrote_since_is_not_replaced_by_an_older_object(
    machines: tuple[str, str],
) -> None:
    one, _ = machines
    mapped = MappedSources("r", "", (MappedSource("old", "", ""),))
    write_mapped_sources(one, BUILDING, STOREY, mapped)
    (path,) = Path(one).rglob("last.parquet")
    path.write_bytes(b"ours, not put yet")
    ahead = path.stat().st_mtime + 10
    os.utime(path, (ahead, ahead))
    shared.refresh(one, "sources")
    assert path.read_bytes() == b"ours, not put yet"


class Failing:
    """A file system whose writes fail some times."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        failures: int,
        error: Exception | None = None,
    ) -> None:
        self.calls = 0
        put_file = MemoryFileSystem.put_file

        def put(*args: object, **kwargs: object) -> None:
            self.calls += 1
            if self.calls <= failures:
                raise error or OSError("503 slow down")
            put_file(*args, **kwargs)

        monkeypatch.setattr(MemoryFileSystem, "put_file", put)


def test_a_folder_is_published_and_replicated_as_it_is_now(machines: tuple[str, str]) -> None:
    one, two = (Path(machine) for machine in machines)

    def put(files: dict[str, bytes]) -> None:
        shutil.rmtree(one / "x", ignore_errors=True)
        for name, data in files.items():
            (one / "x" / name).parent.mkdir(parents=True, exist_ok=True)
            (one / "x" / name).write_bytes(data)
        shared.publish(one, one / "x")

    def got() -> dict[str, bytes]:
        shared.replicate(two, two / "x")
        files = [path for path in (two / "x").rglob("*") if path.is_file()]
        return {path.relative_to(two / "x").as_posix(): path.read_bytes() for path in files}

    for files in ({"a": b"1", "b/c": b"2"}, {"a": b"one", "d": b"3"}):
        put(files)
        assert got() == files
    put({})
    assert got() == files  # nothing is there any more: what is here stays


def test_a_reference_of_nothing_is_told(machines: tuple[str, str]) -> None:
    uri = f"points/building=b/storey=1/{'0' * 24}.parquet"
    assert not is_sound(Ref(uri=uri, sha256="0" * 64, rows=0, table="points"), machines[0])
