"""Rows of stages: none is lost, whoever writes and however many, and files stay small."""

from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from storage import stages
from storage.artifacts import Place
from storage.stages import StageRow, append, forget, of_run


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stages, "FULL_ROWS", 8)
    monkeypatch.setattr(stages, "OPEN_RUNS", 3)


def place(store: Path, run: str = "r") -> Place:
    return Place(store=str(store), run=run, building="b", storey="1")


def row(number: int, run: str = "r") -> StageRow:
    now = datetime(2026, 1, 1, tzinfo=UTC)
    return StageRow(
        str(number), run, None, "made", "key", "computed", 0.1, 0.1, 1.0, 0, 0, 0, 0, None, now
    )


def sizes(store: Path) -> list[int]:
    return sorted(pq.read_metadata(file).num_rows for file in store.rglob("*.parquet"))


def test_a_full_file_is_followed_by_another_and_the_order_stays(tmp_path: Path) -> None:
    for number in range(20):
        append(place(tmp_path), row(number))
    assert sizes(tmp_path) == [4, 8, 8]
    assert [found.id for found in of_run(place(tmp_path))] == [str(n) for n in range(20)]


def test_threads_lose_no_row(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda n: append(place(tmp_path), row(n)), range(50)))
    assert {found.id for found in of_run(place(tmp_path))} == {str(n) for n in range(50)}
    assert sizes(tmp_path) == [2, 8, 8, 8, 8, 8, 8]


def test_threads_of_two_machines_share_every_row(tmp_path: Path, address: str) -> None:
    with ThreadPoolExecutor(8) as threads:
        list(threads.map(lambda n: append(place(tmp_path / "one"), row(n)), range(50)))
    found = of_run(place(tmp_path / "two"))
    assert {of.id for of in found} == {str(n) for n in range(50)}


def test_a_process_that_takes_part_in_many_runs_keeps_few_in_mind_and_all_rows(
    tmp_path: Path,
) -> None:
    runs = [f"r{n}" for n in range(6)]
    for number in range(4):
        for run in runs:
            append(place(tmp_path, run), row(number, run))
    assert len(stages._written) <= 3
    for run in runs:
        assert [found.id for found in of_run(place(tmp_path, run))] == ["0", "1", "2", "3"]


def test_a_run_that_is_forgotten_may_go_on(tmp_path: Path) -> None:
    append(place(tmp_path), row(0))
    forget(place(tmp_path))
    append(place(tmp_path), row(1))
    assert [found.id for found in of_run(place(tmp_path))] == ["0", "1"]
