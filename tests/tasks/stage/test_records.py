"""Cache records: what is not as the stages write it never reaches Prefect."""

import json
from pathlib import Path

import numpy as np
import pytest
from prefect.results import ResultRecord, ResultRecordMetadata
from prefect.serializers import JSONSerializer, PickleSerializer

from storage.artifacts import Place, write
from storage.points import POINTS, PointCloud
from tasks.stage.records import drop_unless_sound, folder, read_refs

KEY = "b/0/s/planes/0123"


class Trap:
    """Touches a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return Path.touch, (self.path,)


def record_of(result, serializer) -> bytes:
    """Return a record as Prefect writes it."""
    metadata = ResultRecordMetadata(serializer=serializer, storage_key="k")
    return ResultRecord(result=result, metadata=metadata).serialize()


@pytest.fixture
def place(tmp_path):
    return Place(store=str(tmp_path / "store"), run="r", building="b", storey="0", scan="s")


@pytest.fixture
def ref(place):
    return write(POINTS, PointCloud(np.ones((3, 3), np.float32), np.zeros(3)), place)


@pytest.fixture
def sound(ref):
    return record_of([ref, ref], JSONSerializer())


@pytest.fixture
def stays(place):
    """Return whether a record stays, once the cache is looked at under its key."""

    def look(data: bytes, key: str = KEY) -> bool:
        path = folder(place.store) / key
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        drop_unless_sound(place.store, key)
        return path.exists()

    return look


def test_what_prefect_writes_is_read_and_stays(stays, sound, ref):
    assert read_refs(sound) == [ref, ref]
    assert read_refs(record_of(ref, JSONSerializer())) == [ref]
    assert stays(sound)


def test_a_pickle_is_dropped_and_never_unpickled(stays, tmp_path):
    harm = tmp_path / "harm"
    trap = record_of(Trap(harm), PickleSerializer())
    assert not stays(trap)
    assert not harm.exists()
    # it would have done harm
    ResultRecord.deserialize(trap)
    assert harm.exists()


def changed(sound, *path, to):
    whole = json.loads(sound)
    *parents, last = path
    part = whole
    for name in parents:
        part = part[name]
    part[last] = to
    return json.dumps(whole).encode()


@pytest.mark.parametrize(
    ("path", "to"),
    [
        (("metadata", "serializer", "type"), "pickle"),
        (("metadata", "serializer", "type"), "compressed/pickle"),
        (("metadata", "serializer", "jsonlib"), "antigravity"),
        (("metadata", "serializer", "object_decoder"), "os.system"),
        (("metadata", "serializer", "loads_kwargs"), {"cls": "x"}),
        (("metadata", "serializer"), {}),
        (("metadata",), None),
        (("serializer",), {"type": "pickle"}),
        (("result",), '{"__class__": "subprocess.Popen", "data": ["true"]}'),
        (("result",), '{"__exc_type__": "SystemExit", "message": "x"}'),
        (("result",), "[1, 2]"),
        (("result",), "[]"),
        (("result",), "[" * 100_000),
        (("result",), None),
    ],
)
def test_a_record_that_would_be_read_otherwise_is_dropped(stays, sound, path, to):
    assert not stays(changed(sound, *path, to=to))


def test_a_record_that_says_how_to_read_it_twice_is_dropped(stays, sound):
    text = sound.decode()
    whole = json.loads(text)
    pickle = whole["metadata"] | {"serializer": {"type": "pickle"}}
    twice = '{"metadata": ' + json.dumps(pickle) + "," + text[1:]
    assert json.loads(twice) == whole  # which of both counts is up to the reader
    assert not stays(twice.encode())


@pytest.mark.parametrize("uri", ["../beside.parquet", "{store}/x.parquet", "points/x.parquet"])
def test_a_record_leads_to_no_file_but_its_own(stays, place, ref, uri):
    path = Path(place.store) / uri.format(store=place.store)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((Path(place.store) / ref.uri).read_bytes())
    elsewhere = ref.model_copy(update={"uri": uri.format(store=place.store)})
    assert not stays(record_of(elsewhere, JSONSerializer()))


def test_a_record_of_another_scan_is_not_this_ones(stays, sound):
    assert stays(sound)
    assert not stays(sound, "b/0/t/planes/0123")
    assert not stays(sound, "b/0/_/rooms/0123")


def test_a_record_whose_artifact_is_cut_is_dropped(stays, sound, place, ref):
    path = Path(place.store) / ref.uri
    path.write_bytes(path.read_bytes()[:-1])
    assert not stays(sound)
