"""What all buildings share: the first deployment of a prefect.yaml."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from storage.errors import InputError

NAME = "prefect.yaml"


class _WorkPool(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    job_variables: dict[str, Any] = {}
    work_queue_name: str | None = None


class _Deployment(BaseModel):
    model_config = ConfigDict(extra="ignore")  # `prefect deploy` knows many more fields

    entrypoint: str
    work_pool: _WorkPool
    tags: tuple[str, ...] = ()
    description: str | None = None


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore")

    deployments: tuple[_Deployment, ...]


@dataclass(frozen=True)
class Shared:
    """What the deployments of all buildings have in common."""

    entrypoint: str
    work_pool: str
    work_queue: str | None = None
    job_variables: dict[str, Any] = field(default_factory=dict)
    tags: tuple[str, ...] = ()
    description: str | None = None


def read_shared(path: Path, work_pool: str | None = None) -> Shared:
    """Read a prefect.yaml.

    Parameters
    ----------
    work_pool : str, optional
        Name of the work pool; None: the file's.

    Raises
    ------
    InputError
        If the file is missing or lacks what is needed.
    """
    try:
        said = _File.model_validate(yaml.safe_load(path.read_text("utf-8")))
    except OSError as error:
        remedy = "copy deployments/prefect.yaml beside the buildings' files, or name one with "
        problem = f"cannot be read ({error.strerror})"
        raise InputError(path, problem, remedy + "--prefect-file") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(path, f"is no YAML ({' '.join(str(error).split())})", "mend it") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise InputError(path, f"field '{where}': {first['msg'].lower()}", "correct it") from error
    if not said.deployments:
        raise InputError(path, "field 'deployments': there is none", "add one: it is the template")
    first_one = said.deployments[0]
    if ":" in first_one.entrypoint:
        problem = f"field 'entrypoint' is '{first_one.entrypoint}', a file"
        remedy = "name an installed module, as flows.scheduled.map_new_scans"
        raise InputError(path, problem, remedy)
    pool = first_one.work_pool
    return Shared(
        first_one.entrypoint,
        work_pool or pool.name,
        pool.work_queue_name,
        pool.job_variables,
        first_one.tags,
        first_one.description,
    )
