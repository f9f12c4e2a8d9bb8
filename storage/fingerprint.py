"""What code decides a stage's result: its module, all of this project it imports, library versions.

A function's own text is not enough: a change in a helper it calls changes its result too. So the
fingerprint covers the closure of first-party imports, found by reading the files, not by running
them.
"""

import ast
import json
import sys
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any

from storage.artifacts import SCHEMA_VERSION

FIRST_PARTY = frozenset({"flows", "tasks", "grammars", "storage"})
WITHOUT = frozenset({"storage.artifacts", "storage.errors"})
"""Modules every stage imports and none takes numbers from: they move tables to and from disk and
word errors. What a changed file form would break is said by the schema version, which counts."""
LIBRARIES = {
    "numpy": ("numpy",),
    "scipy": ("scipy",),
    "numba": ("numba",),
    "pyarrow": ("pyarrow",),
    "shapely": ("shapely",),
    "sklearn": ("scikit-learn",),
    "cv2": ("opencv-python-headless",),
    "open3d": ("open3d", "open3d-cpu"),
    "laspy": ("laspy",),
    "pye57": ("pye57",),
}
"""Libraries whose version may decide a result, by what is imported, and who distributes them."""
ALWAYS = ("numpy", "scipy", "numba", "pyarrow", "shapely")
"""Libraries that count for every stage: they reach each other without an import of ours."""


_parsing = Lock()
"""In Python 3.11 two threads that parse at once can upset the parser's count of its depth:
SystemError, "AST constructor recursion depth mismatch" (CPython issue 106905)."""


def code_fingerprint(fn: Callable[..., Any]) -> str:
    """Return the hash of all code that decides what `fn` returns.

    Comments, layout and docstrings do not count. It is found once per process: after an edit, a
    process that serves must be started again.
    """
    module = sys.modules[fn.__module__]
    package = module.__package__ or ""
    with _parsing:
        return _fingerprint(fn.__qualname__, str(module.__file__), fn.__module__, package)


@cache
def _fingerprint(function: str, file: str, name: str, package: str) -> str:
    roots = FIRST_PARTY | {name.partition(".")[0]}
    seen: dict[str, str] = {}
    imported: set[str] = set(ALWAYS)
    todo = [(name, Path(file), package)]
    while todo:
        name, path, package = todo.pop()
        if name in seen:
            continue
        code, imports = _read(path, package)
        seen[name] = code
        imported |= {i.partition(".")[0] for i in imports}
        found = ((i, _locate(i)) for i in imports if i.partition(".")[0] in roots)
        todo += [(i, *place) for i, place in found if place is not None and i not in WITHOUT]
    # by content, not by name: a script is __main__ here and a module there
    parts = [
        function,
        sorted(seen.values()),
        sorted((library, _version(library)) for library in imported & LIBRARIES.keys()),
        list(sys.version_info[:2]),
        SCHEMA_VERSION,
    ]
    return sha256(json.dumps(parts).encode()).hexdigest()


@cache
def _read(path: Path, package: str) -> tuple[str, tuple[str, ...]]:
    """Return the hash of a module's code, and what it imports anywhere in it."""
    tree = ast.parse(path.read_bytes(), str(path))
    imports = tuple(sorted(set(_imports(tree, package))))
    return sha256(ast.dump(_WithoutDocstrings().visit(tree)).encode()).hexdigest(), imports


def _imports(tree: ast.Module, package: str) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _with_parents(alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = package.rsplit(".", node.level - 1)[0] if node.level else ""
            name = ".".join(part for part in (base, node.module) if part)
            yield from _with_parents(name)
            yield from (f"{name}.{alias.name}" for alias in node.names)  # may be modules


def _with_parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    yield from (".".join(parts[: i + 1]) for i in range(len(parts)))


@cache
def _locate(name: str) -> tuple[Path, str] | None:
    """Return a first-party module's file and package; None for what is no module of Python code.

    The parts of a name are looked up on disk: asking the import system would run the parents.
    """
    top, *rest = name.split(".")
    spec = find_spec(top)
    for folder in (spec.submodule_search_locations or []) if spec is not None else []:
        path = Path(folder, *rest)
        if (init := path / "__init__.py").is_file():
            return init, name
        if rest and (file := path.with_suffix(".py")).is_file():
            return file, name.rpartition(".")[0]
    if spec is not None and not rest and spec.origin is not None and spec.origin.endswith(".py"):
        return Path(spec.origin), ""
    return None


@cache
def _version(library: str) -> str:
    for distribution in LIBRARIES[library]:
        try:
            return f"{distribution} {version(distribution)}"
        except PackageNotFoundError:
            continue
    return "not installed"


class _WithoutDocstrings(ast.NodeTransformer):
    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return None
        return node
