"""What a campaign's folder holds: which scan answers which query, by whom, and the truth."""

import json
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from storage.errors import InputError
from storage.files import write_whole

FILE = "campaign.json"


class CampaignScan(BaseModel):
    """One scan of a campaign."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    scan: str
    """Name of the scan."""
    path: str
    """Where it lies, relative to the campaign's folder."""
    room: str
    """Id in the truth of the room that was asked for."""
    volunteer: str
    """Who scanned."""
    skill: float | None = None
    """Of this scan, 0 to 1; None of a real one."""
    duration_s: float
    """Seconds from the first to the last snapshot."""
    points: int
    """Points captured."""


class CampaignStorey(BaseModel):
    """One storey of a campaign."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    storey: str
    """Name of the storey."""
    truth: str
    """The true plan, GeoJSON, relative to the campaign's folder."""
    scans: tuple[CampaignScan, ...]
    """In the order they were made."""


class Campaign(BaseModel):
    """A crowdsensing campaign in a building."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    building: str
    """Name of the building."""
    simulated: bool
    """Whether the scans are simulated."""
    seed: int | None
    """What it was drawn from; None of a real one."""
    storeys: tuple[CampaignStorey, ...]
    """Storeys that were scanned."""


def write_campaign(campaign: Campaign, folder: Path) -> None:
    """Write a campaign's record into its folder, whole or not at all."""
    text = campaign.model_dump_json(indent=1) + "\n"
    write_whole(folder / FILE, text.encode(), "campaign")


def read_campaign(folder: Path) -> Campaign:
    """Return the campaign a folder holds.

    Raises
    ------
    InputError
        If there is none, or its record cannot be understood.
    """
    path = folder / FILE
    remedy = "name a folder that 'mapsense simulate' made"
    try:
        return Campaign.model_validate(json.loads(path.read_text("utf-8")))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror or error})", remedy) from error
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        raise InputError(path, f"field '{field}': {first['msg'].lower()}", remedy) from error
    except ValueError as error:
        raise InputError(path, f"is no JSON ({error})", remedy) from error
