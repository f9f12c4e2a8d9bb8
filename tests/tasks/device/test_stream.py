"""Streams that were cut, changed or forged are errors, whatever they say."""

import resource
import struct
from hashlib import blake2b

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from storage.errors import MapSenseError
from storage.points import PointCloud
from storage.streams import Stream
from tasks.device import stream
from tasks.device.codec import CodecParams, decode, encode
from tasks.device.stream import CHECKSUM_BYTES, HEADER, DamagedStream, Header, pack, unpack


def some(n, seed=0):
    xyz = np.random.default_rng(seed).normal(0, 0.2, (n, 3)).astype(np.float32)
    return encode(PointCloud(xyz, np.array([1.0, 2.0, 3.0])), CodecParams()).data


def read(data):
    return decode(Stream(data, "low", 0.01, 1, 1))


def signed(body):
    return body + blake2b(body, digest_size=CHECKSUM_BYTES).digest()


STREAMS = {"none": some(0), "one": some(1), "some": some(50)}
every_stream = pytest.mark.parametrize("data", STREAMS.values(), ids=STREAMS)


@every_stream
def test_a_stream_describes_itself(data):
    header, payload = unpack(data)
    assert pack(header, payload) == data
    assert (header.leaf_m, header.profile, header.origin) == (0.01, "low", (1.0, 2.0, 3.0))
    assert len(data) == HEADER.size + len(payload) + CHECKSUM_BYTES


@every_stream
def test_every_truncation_failure(data):
    for length in range(len(data)):
        with pytest.raises(DamagedStream, match=r"^stream: .*send it again$"):
            read(data[:length])


@every_stream
def test_every_flipped_bit_failure(data):
    for place in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[place] ^= 1 << bit
            with pytest.raises(DamagedStream):
                read(bytes(changed))


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_every_changed_byte_failure(data):
    whole = STREAMS["some"]
    place = data.draw(st.integers(0, len(whole) - 1))
    byte = data.draw(st.integers(0, 255).filter(lambda b: b != whole[place]))
    with pytest.raises(DamagedStream):
        read(whole[:place] + bytes([byte]) + whole[place + 1 :])


@every_stream
def test_more_bytes_after_the_end_failure(data):
    with pytest.raises(DamagedStream, match="promises"):
        read(data + b"\0")


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=400))
def test_any_other_bytes_failure(data):
    with pytest.raises(DamagedStream):
        read(data)


def test_another_version_is_named_failure():
    body = bytearray(STREAMS["some"][:-CHECKSUM_BYTES])
    body[8:10] = struct.pack("<H", 2)
    with pytest.raises(DamagedStream, match="version 2, this program reads version 1"):
        read(signed(bytes(body)))


headers = st.builds(
    Header,
    leaf_um=st.sampled_from([0, 1, 1000, 5000, 10_000, 2**32 - 1]),
    points=st.integers(0, 2**64 - 1),
    cells=st.one_of(st.integers(0, 100), st.integers(0, 2**31), st.integers(0, 2**64 - 1)),
    origin=st.tuples(*[st.floats()] * 3),
    low=st.tuples(*[st.integers(-(2**63), 2**63 - 1)] * 3),
    shape=st.tuples(*[st.one_of(st.integers(0, 9), st.integers(0, 2**32 - 1))] * 3),
)
plausible = st.builds(
    Header,
    leaf_um=st.sampled_from([1000, 10_000]),
    points=st.just(2**31),
    cells=st.one_of(st.integers(1, 100), st.just(2**31 - 1)),
    origin=st.just((0.0, 0.0, 0.0)),
    low=st.just((-5, 0, 2**50)),
    shape=st.tuples(*[st.one_of(st.integers(1, 9), st.integers(1, 2**21))] * 3),
)


@settings(max_examples=400, deadline=None)
@given(st.one_of(headers, plausible), st.binary(max_size=200))
def test_a_forged_stream_is_an_error_or_what_its_header_says(header, payload):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        found = read(pack(header, payload))
    except DamagedStream:
        pass
    else:
        assert len(found) == header.cells
    grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    assert (
        grown_mb < 300
    )  # 200 bytes can hold some hundred thousand cells; two thousand million not


@settings(max_examples=100, deadline=None)
@given(st.binary(min_size=1, max_size=60), st.integers(0, 59))
def test_a_forged_payload_is_an_error_or_as_many_cells(noise, place):
    header, payload = unpack(STREAMS["some"])
    changed = payload[:place] + noise + payload[place + len(noise) :]
    try:
        found = read(pack(header, changed))
    except DamagedStream:
        return
    leaves = np.floor((found.origin + found.xyz) / header.leaf_m) - header.low
    assert len(np.unique(leaves, axis=0)) == header.cells
    assert (leaves >= 0).all() and (leaves < header.shape).all()


def test_the_errors_are_meant_for_people():
    assert issubclass(DamagedStream, MapSenseError)
    assert stream.PROFILES[1:] == ("low", "medium", "high")
