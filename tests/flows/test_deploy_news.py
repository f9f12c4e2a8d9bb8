"""What a tick finds at its sources, without any server."""

import os
import time

import fsspec
import pytest

from flows.listing import list_local
from flows.news import find_news, known_by
from storage.errors import InputError
from storage.mapped_sources import MappedSources, read_mapped_sources, write_mapped_sources

NOW = 4e9
"""Long after any file here was written."""


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("a", "b"):
        write(folder / f"{name}.xyz", name)
    return folder


@pytest.fixture
def look(tmp_path):
    """Return what looks at sources, and notes what was found as a successful run does."""
    store = str(tmp_path / "store")

    def look(*scans, settings=None, now=NOW, settle_s=60.0, run=True):
        last = read_mapped_sources(store, "hut", "0")
        news = find_news([str(s) for s in scans], store, settings or {}, last, settle_s, now)
        if run:
            taken = MappedSources("r", known_by(settings or {}), news.sources)
            write_mapped_sources(store, "hut", "0", taken)
        return news

    return look


def write(path, text):
    rows = [f"{i} {len(text)} {ord(text[0])}" for i in range(9)]
    path.write_text("\n".join(rows))


def test_all_is_new_at_first_and_nothing_the_next_time(folder, look):
    assert look(folder).new == ("a.xyz", "b.xyz")
    again = look(folder)
    assert again.new == ()
    assert not again.is_worth_a_run()
    assert len(again.sources) == 2


def test_a_scan_dropped_in_is_new(folder, look):
    look(folder)
    write(folder / "c.xyz", "c")
    news = look(folder)
    assert news.new == ("c.xyz",)
    assert len(news.sources) == 3


def test_a_changed_scan_is_new_and_a_touched_or_renamed_one_is_not(folder, look):
    look(folder)
    os.utime(folder / "a.xyz", (1e9, 1e9))
    (folder / "b.xyz").rename(folder / "renamed.xyz")
    news = look(folder)
    assert (news.new, news.gone) == ((), ())
    write(folder / "a.xyz", "other")
    assert look(folder).new == ("a.xyz",)


def test_a_scan_that_is_still_written_waits(folder, look):
    assert look(folder, now=time.time()).waiting == ("a.xyz", "b.xyz")
    news = look(folder, now=time.time(), settle_s=0)
    assert (news.new, news.waiting) == (("a.xyz", "b.xyz"), ())


def test_what_has_a_temporary_name_is_not_there_yet(folder, look):
    for name in (".c.xyz", "c.xyz.part", "c.xyz~"):
        write(folder / name, "c")
    (folder / "d.scan.tmp").mkdir()
    (folder / "d.scan.tmp" / "points.parquet").write_bytes(b"x")
    (folder / "e.scan").mkdir()
    (folder / "e.scan" / "points.parquet.part").write_bytes(b"x")
    news = look(folder)
    assert news.new == ("a.xyz", "b.xyz")
    assert news.waiting == ("e.scan",)


def test_a_scan_that_cannot_be_read_is_new_once(folder, look):
    (folder / "broken.scan").mkdir()
    assert "broken.scan" in look(folder).new
    assert look(folder).new == ()


def test_other_parameters_are_news_and_scans_that_went_are_not(folder, look):
    look(folder)
    assert look(folder, settings={"hough": {"seed": 1}}, run=False).is_worth_a_run()
    (folder / "b.xyz").unlink()
    news = look(folder)
    assert (news.new, news.gone) == ((), ("b.xyz",))
    assert not news.is_worth_a_run()


def test_a_pattern_names_scans_and_a_missing_folder_is_an_error(folder, look, tmp_path):
    assert look(folder / "[ab].xyz").new == ("a.xyz", "b.xyz")
    assert list_local(str(folder / "*.e57")) == []
    with pytest.raises(InputError, match="nowhere: cannot be read"):
        look(tmp_path / "nowhere")


@pytest.fixture
def bucket(tmp_path):
    system = fsspec.filesystem("memory")
    root = f"/{tmp_path.name}"
    system.pipe(f"{root}/a.xyz", b"1 2 3\n" * 9)
    system.pipe(f"{root}/b.scan/points.parquet", b"x")
    yield system, root
    system.rm(root, recursive=True)


def test_scans_at_an_address_are_fetched_once_and_again_when_they_change(bucket, look, tmp_path):
    system, root = bucket
    address = f"memory:/{root}"
    assert look(address, now=time.time(), run=False).waiting == ("a.xyz", "b.scan")
    assert look(address).new == ("a.xyz", "b.scan")
    (copy,) = [p for p in (tmp_path / "store" / ".sources").iterdir() if p.is_dir()]
    before = (copy / "a.xyz").stat().st_ino
    assert look(address).new == ()
    assert (copy / "a.xyz").stat().st_ino == before
    system.pipe(f"{root}/b.scan/points.parquet", b"other")
    system.rm(f"{root}/a.xyz")
    news = look(address)
    assert (news.new, news.gone) == (("b.scan",), ("a.xyz",))
    assert (copy / "b.scan" / "points.parquet").read_bytes() == b"other"
    assert not (copy / "a.xyz").exists()


def test_an_address_that_cannot_be_read_is_named(look):
    with pytest.raises(InputError, match="nosuch://bucket/x: cannot be read"):
        look("nosuch://bucket/x")
