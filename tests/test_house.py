"""Checks of the house itself: packaging, pinned versions, what an import costs."""

import importlib.util
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions, version
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ["flows", "tasks", "storage", "grammars"]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
GROUPS = PYPROJECT["dependency-groups"]
PINS = [
    Requirement(line.partition(" #")[0])
    for line in (ROOT / "constraints.txt").read_text().splitlines()
    if line.strip() and not line.lstrip().startswith("#")
]


def run(*command: str) -> str:
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("package", PACKAGES)
def test_our_packages_are_imported_from_this_project(package):
    spec = importlib.util.find_spec(package)
    assert spec is not None and spec.origin is not None, f"{package}: not installed"
    assert Path(spec.origin).resolve() == ROOT / package / "__init__.py"


def test_no_other_distribution_brings_a_package_of_our_names():
    # PyPI has distributions called flows, tasks and storage: one would hide or overwrite ours
    owners = packages_distributions()
    others = {name: set(owners.get(name, [])) - {"mapsense"} for name in PACKAGES}
    assert others == {name: set() for name in PACKAGES}


def test_constraints_are_pins_without_an_address():
    assert "://" not in (ROOT / "constraints.txt").read_text()
    for pin in PINS:
        assert [specifier.operator for specifier in pin.specifier] == ["=="], str(pin)
        assert pin.url is None, str(pin)


@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
@pytest.mark.parametrize(
    "dependency",
    [
        *PYPROJECT["project"]["dependencies"],
        *PYPROJECT["project"]["optional-dependencies"]["scale"],
        *(wanted for group in GROUPS.values() for wanted in group),
    ],
    ids=lambda dependency: Requirement(dependency).name,
)
def test_a_direct_dependency_is_pinned_within_its_range(dependency, python):
    wanted = Requirement(dependency)
    environment = {
        **default_environment(),
        "python_version": python,
        "python_full_version": f"{python}.9",
    }
    versions = [
        next(iter(pin.specifier)).version
        for pin in PINS
        if pin.name == wanted.name and (pin.marker is None or pin.marker.evaluate(environment))
    ]
    assert len(versions) == 1, f"{wanted.name} on Python {python}: pinned to {versions}"
    assert versions[0] in wanted.specifier


@pytest.mark.parametrize(
    ("distribution", "working"),
    [
        ("prefect", "==3.8.*"),
        # 0.155 and later: Body() got an unexpected keyword argument, at the first start of a server
        ("fastapi", "<0.151"),
        # 2.1: the server's scheduler fails in its log only, and no scheduled run is ever made
        ("sqlalchemy", "<2.1"),
    ],
)
def test_installed_versions_are_the_ones_that_work_together(distribution, working):
    assert version(distribution) in SpecifierSet(working)


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a git work tree")
def test_no_file_names_the_host_of_a_package_registry():
    hosts = [
        b".".join(labels)
        for labels in [
            (b"pypi", b"org"),
            (b"pythonhosted", b"org"),
            (b"deb", b"debian", b"org"),
            (b"archive", b"ubuntu", b"com"),
            (b"registry", b"npmjs", b"org"),
            (b"conda", b"anaconda", b"org"),
        ]
    ]
    listed = run("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    files = [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]
    assert files
    found = [
        f"{file.relative_to(ROOT)}: {host.decode()}"
        for file in files
        for host in hosts
        if host in file.read_bytes()
    ]
    assert found == []


def test_open3d_finds_its_system_libraries():
    run(sys.executable, "-c", "import open3d")


@pytest.mark.skipif(not (ROOT / "flows/cli.py").exists(), reason="flows/cli.py is not there yet")
def test_the_command_line_starts_without_the_heavy_libraries():
    heavy = "{'open3d', 'prefect', 'sklearn'}"
    loaded = run(sys.executable, "-c", f"import sys, flows.cli; print(*{heavy} & set(sys.modules))")
    assert loaded.split() == []
