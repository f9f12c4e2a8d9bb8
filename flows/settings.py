"""Where things are: mapsense.toml < environment MAPSENSE_* < flags.

    # mapsense.toml
    store = "/data/mapsense"
    jobs = 4
    [params.hough]
    gamma_cell = 25

The same from the environment: MAPSENSE_STORE=/data/mapsense, MAPSENSE_PARAMS__HOUGH__GAMMA_CELL=25.
"""

import os
import re
import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, PositiveFloat, PositiveInt, ValidationError, field_validator
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
    SettingsError,
    TomlConfigSettingsSource,
)

from storage.errors import MapSenseError

ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://[^@?#]+")
FILE = "mapsense.toml"
PREFIX = "MAPSENSE_"
OF_PROCESSES = ("stage_timeout_s", "stage_memory_mb", "dask", "remote")
"""Settings that are taken from the environment of the process stages are run by."""


def default_jobs() -> int:
    """Return how many stages run at once unless it is set: one per processor we may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Settings(BaseSettings):
    """What is set outside of a call."""

    model_config = SettingsConfigDict(
        env_prefix=PREFIX,
        env_nested_delimiter="__",
        toml_file=FILE,
        extra="forbid",
        frozen=True,
        use_attribute_docstrings=True,
    )

    store: Path = Path("mapsense-store")
    """Folder of everything that is kept."""
    jobs: PositiveInt = Field(default_factory=default_jobs)
    """Stages that run at once."""
    remote: str | None = None
    """Address, such as s3://bucket/prefix, that the store shares all it holds with."""
    dask: str | None = None
    """Address of the Dask scheduler whose workers run the stages. Not set: threads, here."""
    stage_timeout_s: PositiveFloat | None = None
    """Seconds after which a stage is stopped, its scan skipped. Not set: never."""
    stage_memory_mb: PositiveInt | None = None
    """Memory a stage may take before it fails, its scan skipped. Not set: all there is."""
    log: Literal["none", "text", "json"] = "none"
    """Whether each event of a run is written on stderr, and as what: for runs nobody watches."""
    params: dict[str, Any] = {}
    """Parameters of the stages, by stage: what flags and defaults leave open."""

    @field_validator("remote")
    @classmethod
    def _is_an_address(cls, value: str | None) -> str | None:
        if value is not None and not ADDRESS.fullmatch(value):
            raise ValueError("Expected an address without credentials, as s3://bucket/prefix")
        return value

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """Let flags win over the environment, and that over the file."""
        return init_settings, env_settings, TomlConfigSettingsSource(settings_cls)


def load_settings(**flags: Any) -> Settings:
    """Return the settings; flags that are None leave a setting to the environment and the file.

    Raises
    ------
    MapSenseError
        If a setting is unknown or cannot be understood.
    """
    _check_environment()
    given = {name: value for name, value in flags.items() if value is not None}
    try:
        settings = Settings(**given)
    except tomllib.TOMLDecodeError as error:
        raise MapSenseError(f"{Path(FILE).resolve()}: is no TOML ({error})") from error
    except OSError as error:
        raise MapSenseError(f"{Path(FILE).resolve()}: cannot be read ({error.strerror})") from error
    except SettingsError as error:
        raise MapSenseError(f"environment {PREFIX}*: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            raise MapSenseError(f"{FILE}: {_unknown(name)}") from error
        raise MapSenseError(
            f"setting '{name}' = {first['input']!r}: {first['msg'].lower()}"
        ) from error
    for name in OF_PROCESSES:
        if (value := getattr(settings, name)) is not None:
            os.environ[f"{PREFIX}{name.upper()}"] = str(value)
    return settings


def _check_environment() -> None:
    """Refuse unknown MAPSENSE_* variables: pydantic-settings passes over them in silence."""
    for variable in sorted(os.environ):
        if variable.upper().startswith(PREFIX):
            name = variable[len(PREFIX) :].lower().partition("__")[0]
            if name not in Settings.model_fields:
                raise MapSenseError(f"environment {variable}: {_unknown(name)}")


def _unknown(name: str) -> str:
    known = list(Settings.model_fields)
    close = get_close_matches(name, known, n=1)
    hint = f"did you mean '{close[0]}'" if close else f"there are {', '.join(known)}"
    return f"unknown setting '{name}': {hint}"
