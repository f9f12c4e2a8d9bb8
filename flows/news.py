"""What is new at the sources of a storey since its last successful run."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from flows.listing import Listed, is_remote, list_local
from flows.mirror import mirror
from storage.errors import InputError
from storage.mapped_sources import MappedSource, MappedSources
from tasks.scans.sources import fingerprint


@dataclass(frozen=True)
class News:
    """The scans of a storey now, and what of them the last successful run did not have."""

    sources: tuple[MappedSource, ...]
    """all that can be taken"""
    new: tuple[str, ...] = ()
    """names of those whose content no run has taken yet"""
    waiting: tuple[str, ...] = ()
    """names of those that are still being written"""
    gone: tuple[str, ...] = ()
    """names of those the last run had, and that are no more"""
    other_settings: bool = False
    """whether the last run was asked for with other parameters"""

    def is_worth_a_run(self) -> bool:
        """Return whether mapping the storey could give anything but what there is."""
        return bool(self.new or (self.other_settings and self.sources))


def find_news(
    scans: Sequence[str],
    store: str,
    settings: Mapping[str, Any],
    last: MappedSources | None,
    settle_s: float,
    now: float,
) -> News:
    """Look at a storey's sources.

    Parameters
    ----------
    scans : sequence of str
        Scan files, folders and patterns of such, or addresses as s3://bucket/prefix.
    settings : mapping
        Parameters as they were set, by stage.
    last : MappedSources, optional
        What the last successful run took; None: there was none.
    settle_s : float
        A scan that was written less than so many seconds ago waits.
    now : float
        Seconds since 1970.

    Raises
    ------
    InputError
        If a source is not there or cannot be read.
    """
    listed, waiting = _listed(scans, store, settle_s, now)
    known = {source.url: source for source in last.sources} if last is not None else {}
    sources = tuple(_source(scan, known) for scan in listed)
    taken = {_identity(source) for source in known.values()}
    here = {source.url for source in sources} | {_identity(source) for source in sources}
    missing = [s for s in known.values() if s.url not in here and _identity(s) not in here]
    return News(
        sources=sources,
        new=tuple(
            scan.name
            for scan, source in zip(listed, sources, strict=True)
            if _identity(source) not in taken
        ),
        waiting=tuple(waiting),
        gone=tuple(Path(s.url).name for s in missing if Path(s.url).name not in waiting),
        other_settings=last is not None and last.settings != known_by(settings),
    )


def known_by(settings: Mapping[str, Any]) -> str:
    """Return what parameters are known by: another text is another setting."""
    text = json.dumps(settings, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:24]


def _listed(
    scans: Sequence[str], store: str, settle_s: float, now: float
) -> tuple[list[Listed], list[str]]:
    """Return the scans that can be taken, and the names of those that wait."""
    found: dict[str, Listed] = {}
    waiting: list[str] = []
    for source in scans:
        if is_remote(source):
            copy = mirror(source, Path(store) / ".sources", settle_s, now)
            waiting += copy.waiting
            found |= {scan.url: scan for scan in list_local(str(copy.folder))}
            continue
        for scan in list_local(source):
            if not scan.is_whole or now - scan.changed_at < settle_s:
                waiting.append(scan.name)
            else:
                found[scan.url] = scan
    return [found[url] for url in sorted(found)], waiting


def _source(scan: Listed, known: Mapping[str, MappedSource]) -> MappedSource:
    """Return a scan with the hash of its content, read only if it may be another one."""
    before = known.get(scan.url)
    if before is not None and before.stamp == scan.stamp:
        return before
    try:
        content = fingerprint(Path(scan.url)).sha256
    except InputError:
        content = ""  # the run says what is wrong with it, once
    return MappedSource(scan.url, scan.stamp, content)


def _identity(source: MappedSource) -> str:
    return source.sha256 or f"{source.url} {source.stamp}"
