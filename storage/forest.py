"""A trained forest: its trees as flat arrays, in one Parquet file, with what it was trained on.

Nothing in the file is code: no reading of it runs anything. It is checked as a stranger's would
be before a tree is walked: a node that led back to itself would never let a prediction end.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from storage.artifacts import column, replace_table, schema
from storage.errors import InputError
from storage.forest_provenance import Provenance
from storage.table_files import UnsoundFile, opened

TABLE = "forest"
LEAF = -1
"""The feature and the children of a node that asks nothing."""
SUM_TOLERANCE = 1e-6
"""How far the shares of a leaf may be off one: sums of doubles, or of a library's floats."""


@dataclass(frozen=True, eq=False)
class Forest:
    """t trees of n nodes in all; entry i is one node in every array of nodes.

    A tree's nodes lie side by side, a parent before its children. A node sends an example to
    `left` if its feature, as a 32-bit float, is at most the threshold, else to `right`; NaN goes
    where `nan_left` says. What the trees' leaves hold is averaged.
    """

    features: tuple[str, ...]
    """names of the k features, in the order of an example's columns"""
    classes: tuple[str, ...]
    """names of the c classes, in the order of the shares' columns"""
    roots: NDArray[np.int64]
    """(t,), first node of each tree, ascending"""
    asked: NDArray[np.int32]
    """(n,), the feature a node asks for; LEAF for none"""
    thresholds: NDArray[np.float64]
    """(n,), in the feature's unit; inf tells the known from the unknown; 0 at leaves"""
    nan_left: NDArray[np.bool_]
    """(n,), where an unknown feature goes; False at leaves"""
    left: NDArray[np.int64]
    """(n,), node; LEAF for none"""
    right: NDArray[np.int64]
    """(n,), node; LEAF for none"""
    shares: NDArray[np.float64]
    """(n, c), share of each class at a leaf, which sum to one; 0 elsewhere"""
    provenance: Provenance

    def __len__(self) -> int:
        return len(self.roots)


class _Header(BaseModel):
    """What a file says besides its nodes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    features: tuple[str, ...]
    classes: tuple[str, ...]
    provenance: Provenance


HEADER = b"mapsense.forest"
SCHEMA = schema(
    TABLE,
    [
        column("tree", pa.int32(), "the tree a node is of"),
        column("feature", pa.int32(), "the feature asked for, by its place in the names; -1: leaf"),
        column("threshold", pa.float64(), "at most this goes left, in the feature's unit"),
        column("nan_left", pa.bool_(), "whether an unknown feature goes left"),
        column("left", pa.int64(), "node by its row; -1: leaf"),
        column("right", pa.int64(), "node by its row; -1: leaf"),
        column("shares", pa.list_(pa.float64()), "share of each class at a leaf, else empty"),
    ],
)


def write_forest(forest: Forest, path: Path) -> None:
    """Write a forest as one Parquet file; a reader sees the old one or the new one.

    Raises
    ------
    StoreError
        If the file cannot be written.
    """
    replace_table(path, to_table(forest))


def read_forest(path: Path, features: tuple[str, ...], classes: tuple[str, ...]) -> Forest:
    """Read a forest that tells some classes apart by some features.

    Parameters
    ----------
    features, classes : names that the file must have, in that order

    Raises
    ------
    InputError
        If the file is no forest, is of other features or classes, or is damaged.
    """
    forest = open_forest(path)
    for what, found, wanted in (
        ("features", forest.features, features),
        ("classes", forest.classes, classes),
    ):
        if found != wanted:
            raise InputError(
                path,
                f"the forest's {what} are {_names(found)}, expected {_names(wanted)}",
                "name another file, or train it anew with 'mapsense train'",
            )
    return forest


def open_forest(path: Path) -> Forest:
    """Read a forest, whatever it tells apart; InputError as of `read_forest`."""
    if not path.is_file():
        _refuse(path, "there is no such file")
    try:
        with opened(path, TABLE, SCHEMA) as file:
            table = file.read()
    except (UnsoundFile, OSError, pa.ArrowException) as error:
        _refuse(path, " ".join(str(error).split()))
    return from_table(table, path)


def to_table(forest: Forest) -> pa.Table:
    """Return one row per node."""
    nodes = len(forest.asked)
    sizes = np.where(forest.asked == LEAF, len(forest.classes), 0)
    ends = np.concatenate(([0], np.cumsum(sizes))).astype(np.int32)
    held = forest.shares[forest.asked == LEAF].ravel()
    columns = [
        pa.array(np.searchsorted(forest.roots, np.arange(nodes), "right") - 1, pa.int32()),
        pa.array(forest.asked),
        pa.array(forest.thresholds),
        pa.array(forest.nan_left),
        pa.array(forest.left),
        pa.array(forest.right),
        pa.ListArray.from_arrays(ends, held),
    ]
    header = _Header(features=forest.features, classes=forest.classes, provenance=forest.provenance)
    metadata = SCHEMA.metadata | {HEADER: header.model_dump_json().encode()}
    return pa.table(columns, schema=SCHEMA.with_metadata(metadata))


def from_table(table: pa.Table, path: Path) -> Forest:
    """Return the forest a table holds; `path` is what errors name.

    Raises
    ------
    InputError
        If it is no forest that a prediction could walk.
    """
    header = _header(table, path)
    for name in SCHEMA.names:
        if table[name].null_count:
            _refuse(path, f"column '{name}' has no value in {table[name].null_count} rows")
    asked, tree = table["feature"].to_numpy(), table["tree"].to_numpy()
    forest = Forest(
        features=header.features,
        classes=header.classes,
        roots=_roots(tree, path),
        asked=asked,
        thresholds=table["threshold"].to_numpy(),
        nan_left=table["nan_left"].to_numpy(),
        left=table["left"].to_numpy(),
        right=table["right"].to_numpy(),
        shares=_shares(table["shares"].combine_chunks(), asked, len(header.classes), path),
        provenance=header.provenance,
    )
    _check_questions(forest, path)
    _check_children(forest, tree, path)
    return forest


def _header(table: pa.Table, path: Path) -> _Header:
    try:
        header = _Header.model_validate_json(table.schema.metadata.get(HEADER, b""))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "header"
        _refuse(path, f"metadata '{HEADER.decode()}', {where}: {first['msg'].lower()}")
    for what, names in (("features", header.features), ("classes", header.classes)):
        if not names or len(set(names)) < len(names):
            _refuse(path, f"its {what} are {_names(names)}, expected some, each once")
    return header


def _roots(tree: NDArray[np.int32], path: Path) -> NDArray[np.int64]:
    """Return the first node of each tree, which must be numbered from 0 on, side by side."""
    steps = np.diff(tree, prepend=-1)
    if not len(tree) or tree[0] != 0 or not np.isin(steps, (0, 1)).all():
        _refuse(path, "column 'tree' does not number trees from 0 on, node beside node")
    return np.flatnonzero(steps == 1)


def _shares(
    lists: pa.ListArray, asked: NDArray[np.int32], classes: int, path: Path
) -> NDArray[np.float64]:
    """Return the shares of all nodes, zeros where one asks for a feature."""
    leaf = asked == LEAF
    sizes = lists.value_lengths().to_numpy()
    if wrong := _first(sizes != np.where(leaf, classes, 0)):
        _refuse(path, f"column 'shares' of {wrong}: {classes} classes are held by leaves alone")
    held = lists.flatten()
    if held.null_count:
        _refuse(path, "column 'shares' has a share without a value")
    shares = np.zeros((len(asked), classes))
    shares[leaf] = held.to_numpy(zero_copy_only=False).reshape(-1, classes)
    # NaN compares false with everything: what is asked is whether all is well
    sound = (shares >= 0).all(axis=1) & (np.abs(shares.sum(axis=1) - leaf) <= SUM_TOLERANCE)
    if wrong := _first(~sound):
        _refuse(path, f"column 'shares' of {wrong}: expected shares of 0 to 1 that sum to 1")
    return shares


def _check_questions(forest: Forest, path: Path) -> None:
    inside = (forest.asked >= LEAF) & (forest.asked < len(forest.features))
    if wrong := _first(~inside):
        _refuse(path, f"column 'feature' of {wrong}: there are {len(forest.features)} features")
    if wrong := _first(~(forest.thresholds > -np.inf)):
        _refuse(path, f"column 'threshold' of {wrong}: expected a number, or inf to go left")


def _check_children(forest: Forest, tree: NDArray[np.int32], path: Path) -> None:
    """Refuse nodes that are not the trees they should be.

    Children behind their parents, in its tree, make no cycle; nobody's child twice, and no root
    but the first node of a tree, make it a tree.
    """
    nodes = np.arange(len(forest.asked))
    leaf = forest.asked == LEAF
    for name, children in (("left", forest.left), ("right", forest.right)):
        if wrong := _first(leaf & (children != LEAF)):
            _refuse(path, f"column '{name}' of {wrong}: it is a leaf and has a child")
        if wrong := _first(~leaf & ((children <= nodes) | (children >= len(nodes)))):
            _refuse(path, f"column '{name}' of {wrong}: expected a later node of its tree")
        if wrong := _first(~leaf & (tree[np.where(leaf, nodes, children)] != tree)):
            _refuse(path, f"column '{name}' of {wrong}: its child is of another tree")
    parents = np.bincount(
        np.concatenate((forest.left[~leaf], forest.right[~leaf])), minlength=len(nodes)
    )
    expected = np.ones(len(nodes), int)
    expected[forest.roots] = 0
    if wrong := _first(parents != expected):
        _refuse(path, f"columns 'left' and 'right': {wrong} is the child of none or of several")


def _first(wrong: NDArray[np.bool_]) -> str:
    """Return what people call the first row that is wrong, '' if none is."""
    return f"row {int(wrong.argmax())}" if wrong.any() else ""


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(names) or "none"


def _refuse(path: Path, problem: str) -> NoReturn:
    raise InputError(path, f"is no sound forest: {problem}", "train it with 'mapsense train'")
