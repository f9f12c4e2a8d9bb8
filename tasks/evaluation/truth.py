"""The true plan of a storey, in whichever form people have it."""

from pathlib import Path

from storage.errors import InputError
from storage.plan import Plan
from storage.plan_geojson import read_plan
from storage.plan_ifc import ifc_storeys, read_ifc_storey
from tasks.evaluation.label_files import is_labels, label_files, read_labels
from tasks.evaluation.labels import LabelParams, plan_from_labels

PLAN_SUFFIXES = (".geojson", ".json")
IFC_SUFFIXES = (".ifc",)


def read_truth(path: Path | str, storey: str | None = None) -> Plan:
    """Return the true plan that a file or folder holds.

    Parameters
    ----------
    path : one of
        a plan, `.geojson`; a building model, `.ifc`; point labels: a `.toml` or `.json` that names
        labelled clouds, or a folder in S3DIS layout (see `read_labels`), from which rooms, doors
        and furniture are derived; the plan's notes say so.
    storey : str, optional
        Which storey of a building model is meant; not needed where it holds one alone. Of the
        other forms, which hold one storey, the name it must have.

    Raises
    ------
    InputError
        If the file is missing, of none of these forms, or wrong in a field; if it holds several
        storeys and none was named; if the named storey is not in it.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(path, "there is no such file", "check the path")
    if path.suffix.lower() in IFC_SUFFIXES:
        return read_ifc_storey(path, storey if storey is not None else _only_storey(path))
    if is_labels(path):
        return _named(plan_from_labels(read_labels(path), LabelParams()), path, storey)
    if path.suffix.lower() in PLAN_SUFFIXES:
        return _named(read_plan(path), path, storey)
    remedy = "expected .geojson, .ifc, .toml or .json naming labelled points, or an S3DIS folder"
    raise InputError(path, f"'{path.suffix}' is no form of truth", remedy)


def truth_files(path: Path | str) -> tuple[Path, ...]:
    """Return every file whose bytes decide what `read_truth` returns.

    Raises
    ------
    InputError
        If a file of point labels cannot be read.
    """
    path = Path(path)
    return label_files(path) if is_labels(path) else (path,)


def _only_storey(path: Path) -> str:
    """Return the storey that is meant if nobody says which."""
    storeys = list(ifc_storeys(path))
    if len(storeys) > 1:
        listed = ", ".join(f"'{name}'" for name in storeys)
        raise InputError(path, f"holds {len(storeys)} storeys: {listed}", "name the one meant")
    return storeys[0]


def _named(plan: Plan, path: Path, storey: str | None) -> Plan:
    if storey is not None and plan.storey != storey:
        wrong = f"is storey '{plan.storey}', not '{storey}'"
        raise InputError(path, wrong, "name that storey, or hand over the right file")
    return plan
