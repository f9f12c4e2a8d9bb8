"""The stream format: a header that says what it is, the payload, a checksum. See STREAM.md."""

import struct
from dataclasses import dataclass
from hashlib import blake2b

from storage.errors import MapSenseError
from tasks.device.lattice import EXACT, MAX_DEPTH

MAGIC = b"\x89MSO\r\n\x1a\n"
"""No text begins so, and transfers that change line ends change it (as in PNG)."""
VERSION = 1
HEADER = struct.Struct("<8sHBBIQQ3d3q3IQ")
CHECKSUM_BYTES = 8
MAX_CELLS = 2**31 - 1
"""Leaves of a stream: nodes are counted in 32 bits."""
PROFILE_LEAVES_UM = {"low": 10_000, "medium": 5_000, "high": 1_000}
"""Edge of a leaf, micrometres: the resolutions of PCL's compression profiles."""
OTHER = "other"
"""Profile of any other leaf."""
PROFILES = (OTHER, *PROFILE_LEAVES_UM)
"""By their number in the header."""


class DamagedStream(MapSenseError):
    """The bytes are not a whole, unchanged stream that this version reads."""


@dataclass(frozen=True)
class Header:
    """What a stream says about itself."""

    leaf_um: int
    """edge of a leaf, micrometres"""
    points: int
    """points that were encoded"""
    cells: int
    """occupied leaves"""
    origin: tuple[float, float, float]
    """origin of the cloud, building frame, metres"""
    low: tuple[int, int, int]
    """first cell of the bounding box; cell c covers [c leaf, (c + 1) leaf) of the building frame"""
    shape: tuple[int, int, int]
    """cells of the bounding box along each axis; zero for no points"""

    @property
    def profile(self) -> str:
        """The profile with this leaf."""
        names = {leaf: name for name, leaf in PROFILE_LEAVES_UM.items()}
        return names.get(self.leaf_um, OTHER)

    @property
    def leaf_m(self) -> float:
        """Edge of a leaf, metres."""
        return self.leaf_um / 1e6

    @property
    def depth(self) -> int:
        """Levels of the octree: its root is the smallest cube of 2^depth cells over the box."""
        return max(max(self.shape) - 1, 0).bit_length()


def pack(header: Header, payload: bytes) -> bytes:
    """Return the stream of a header and a payload."""
    head = HEADER.pack(
        MAGIC, VERSION, PROFILES.index(header.profile), header.depth, header.leaf_um,
        header.points, header.cells, *header.origin, *header.low, *header.shape, len(payload),
    )  # fmt: skip
    return head + payload + _checksum(head + payload)


def unpack(data: bytes) -> tuple[Header, bytes]:
    """Return header and payload of a stream.

    Raises
    ------
    DamagedStream
        If the bytes are cut, changed or none of ours, or of a version unknown here.
    """
    if len(data) < HEADER.size + CHECKSUM_BYTES:
        raise _damaged(f"{len(data)} bytes are fewer than a header and a checksum have")
    magic, version, profile, depth, leaf_um, points, cells, *numbers, length = HEADER.unpack_from(
        data
    )
    if magic != MAGIC:
        raise _damaged(f"it begins with {magic.hex(' ')}, expected {MAGIC.hex(' ')}")
    if version != VERSION:
        raise DamagedStream(
            f"stream: version {version}, this program reads version {VERSION}; "
            "update the older of device and server, or send the scan again"
        )
    if len(data) != HEADER.size + length + CHECKSUM_BYTES:
        expected = HEADER.size + length + CHECKSUM_BYTES
        raise _damaged(f"{len(data)} bytes where its header promises {expected}")
    body, checksum = data[:-CHECKSUM_BYTES], data[-CHECKSUM_BYTES:]
    if _checksum(body) != checksum:
        raise _damaged("its checksum does not fit its bytes")
    header = Header(
        leaf_um, points, cells, tuple(numbers[:3]), tuple(numbers[3:6]), tuple(numbers[6:])
    )
    if not _is_sound(header) or (profile, depth) != (
        PROFILES.index(header.profile),
        header.depth,
    ):
        raise _damaged("its header contradicts itself")
    return header, body[HEADER.size :]


def _is_sound(header: Header) -> bool:
    """Return whether a header is one that an encoder could have written."""
    return (
        header.leaf_um > 0
        and all(abs(value) < EXACT for value in (*header.origin, *header.low))  # NaN is not
        and header.cells <= min(header.points, MAX_CELLS)
        and (header.cells > 0) == (header.points > 0) == (min(header.shape) > 0)
        and (header.cells > 0 or max(header.shape) == 0)
        and header.depth <= MAX_DEPTH
    )


def _damaged(what: str) -> DamagedStream:
    return DamagedStream(f"stream: {what}; it was damaged on its way, send it again")


def _checksum(body: bytes) -> bytes:
    return blake2b(body, digest_size=CHECKSUM_BYTES).digest()
