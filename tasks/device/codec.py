"""Octree compression of a cloud on the device, and its decoding on the server (Sec. 3.3)."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from storage.points import PointCloud
from storage.streams import Stream
from tasks.device import cells, octree
from tasks.device.lattice import OutOfReach, box_around
from tasks.device.stream import PROFILE_LEAVES_UM, DamagedStream, Header, pack, unpack
from tasks.params import Params

LEAST_STEPS = 4
"""Steps of a 32-bit coordinate within a leaf: then a centre stays well within its leaf."""
ALIGNED = 16
"""Nodes of up to so many leaves a side have their borders at multiples of their size in the
building frame: then each voxel of an earlier voxel grid of 2, 4, 8 or 16 leaves is one node."""


class CodecParams(Params):
    """What of the cloud is kept."""

    profile: Literal["low", "medium", "high"] = "low"
    """Resolution: leaves of 1 cm, 5 mm or 1 mm, as the profiles of PCL's point cloud compression
    (Sec. 3.3 names no numbers). The leaf must be smaller than the voxel, which then sets what is
    kept."""


def encode(points: PointCloud, params: CodecParams) -> Stream:
    """Compress a cloud: each point is replaced by the centre of the octree leaf it lies in.

    Leaves are the cells of the lattice whose lines are the multiples of the leaf's edge in the
    building frame. Which snapshot saw a point, how many lay in a leaf, and their order are lost.

    Parameters
    ----------
    points : PointCloud
        n points; n may be 0.

    Returns
    -------
    Stream
        The same for every order of the points.

    Raises
    ------
    OutOfReach
        If the points lie too far apart, or too far from their origin, for leaves of this size.
    """
    return encode_leaves(points, PROFILE_LEAVES_UM[params.profile])


def encode_leaves(points: PointCloud, leaf_um: int) -> Stream:
    """Compress a cloud with leaves of any whole number of micrometres; see `encode`."""
    x, y, z = points.origin.tolist()
    if len(points):
        header, payload = _encode(points, leaf_um)
    else:
        header, payload = Header(leaf_um, 0, 0, (x, y, z), (0, 0, 0), (0, 0, 0)), b""
    data = pack(header, payload)
    return Stream(data, header.profile, header.leaf_m, header.points, header.cells)


def decode(stream: Stream) -> PointCloud:
    """Return the centres of a stream's leaves, in Morton order, with the encoded cloud's origin.

    Raises
    ------
    DamagedStream
        If the stream is cut or changed in any byte.
    """
    header, payload = unpack(stream.data)
    origin = np.array(header.origin)
    if not header.cells:
        if payload:
            raise DamagedStream("stream: a payload of no points; send it again")
        return PointCloud(np.empty((0, 3), np.float32), origin)
    try:
        keys = octree.decode_cells(payload, header.depth, header.cells)
    except octree.PayloadError as error:
        raise DamagedStream(f"stream: {error}; send it again") from error
    leaves = cells.morton_cells(keys)
    if (leaves >= np.array(header.shape)).any():
        raise DamagedStream("stream: a cell lies outside its bounds; send it again")
    xyz = cells.centres(leaves, np.array(header.low, np.int64), header.leaf_m, origin)
    return PointCloud(xyz, origin)


def _encode(points: PointCloud, leaf_um: int) -> tuple[Header, bytes]:
    leaf = leaf_um / 1e6
    box = box_around(points, leaf, np.zeros(3), ALIGNED)
    _check_steps(points.xyz, leaf)
    keys = cells.morton_keys(points.xyz, box.shift, leaf, box.low)
    keys = cells.sorted_unique(keys, 3 * box.depth)
    x, y, z = points.origin.tolist()
    a, b, c = box.low.tolist()
    i, j, k = box.shape.tolist()
    header = Header(leaf_um, len(points), len(keys), (x, y, z), (a, b, c), (i, j, k))
    return header, octree.encode_cells(keys, box.depth)


def _check_steps(xyz: NDArray[np.float32], leaf: float) -> None:
    farthest = np.float32(max(abs(xyz.min()), abs(xyz.max())))
    if LEAST_STEPS * float(np.spacing(farthest)) > leaf:
        raise OutOfReach(
            f"points: {farthest:.0f} m from the cloud's origin, where 32-bit coordinates cannot "
            f"hold leaves of {leaf:g} m; move the origin to the scan, or choose a coarser profile"
        )
