"""What is compared: a file a person writes, or a campaign's folder alone.

# experiment.toml; paths are relative to this file
campaigns = ["campaign"]            # folders that 'mapsense simulate' made
seeds = 10                          # or a list: [0, 3, 7]; 10 unless it is said
train = ["plans/west.geojson"]      # plans something was learnt from: none may be scored
train_names = ["library/1"]         # the same, as building/storey

[[storeys]]                         # real scans, with a true plan
building = "library"
storey = "2"
scans = ["scans/level2"]
truth = "plans/level2.geojson"      # or labelled points; or a building model, and its storey:
# truth_storey = "Level 2"

[variants.default]                  # parameters over the defaults: none

[variants.coarse.voxels]            # voxels.edge_m of the variant "coarse"
edge_m = 0.05

[variants.own]                      # a grammar for each building; {storey} works likewise
grammar = "grammars/{building}.toml"
"""

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from flows.assignments import merged
from flows.disjoint import Learnt, ScoredStorey, learnt_from
from flows.experiment import SEEDS, ExperimentRequest, Seeds
from flows.params import MapSenseParams, parse_params
from flows.seeds import seeds_in
from grammars.library import library
from storage.artifacts import check_name
from storage.campaign import FILE, CampaignStorey, read_campaign
from storage.errors import InputError, MapSenseError
from storage.runs import DEFAULT, INITIAL_MODEL

Settings = Mapping[str, Any]
"""Parameters by stage, as people set them."""


def _counted(given: Any) -> Any:
    """Return the seeds that a number of seeds stands for."""
    if isinstance(given, int) and not isinstance(given, bool):
        if given < 1:
            raise ValueError("expected at least one seed")
        return tuple(range(given))
    return given


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class StoreyEntry(_Strict):
    """Real scans of a storey, with its true plan."""

    building: str
    """Name its results are kept under."""
    storey: str
    """Name of the storey."""
    scans: Annotated[tuple[str, ...], Field(min_length=1)]
    """Scan files, folders of one scan, or folders of scans."""
    truth: str
    """The true plan: GeoJSON, IFC, or labelled points."""
    truth_storey: str | None = None
    """Its storey of a building model; None: it has one alone."""


class ExperimentFile(_Strict):
    """What an experiment's file says."""

    campaigns: tuple[str, ...] = ()
    """Folders that `mapsense simulate` made: every storey is scored."""
    storeys: tuple[StoreyEntry, ...] = ()
    """Storeys that really were scanned."""
    variants: dict[str, dict[str, Any]] = {DEFAULT: {}}
    """Parameters over the defaults, by the name of the variant."""
    seeds: Annotated[Seeds, BeforeValidator(_counted)] = SEEDS
    """How many repeats, or the seed of each."""
    train: tuple[str, ...] = ()
    """Plans something was learnt from."""
    train_names: tuple[str, ...] = ()
    """The same, as `building/storey`."""


def read_experiment(path: Path, store: str, base: Settings) -> ExperimentRequest:
    """Return the experiment a file describes.

    Parameters
    ----------
    base : mapping
        Parameters that variants leave as they are, by stage: of settings and flags.

    Raises
    ------
    InputError
        Naming the file, the field that is wrong, and the remedy.
    """
    said, folder = _read(path), path.parent
    storeys = [s for name in said.campaigns for s in campaign_storeys(folder / name)]
    storeys += [_entry(path, i, entry) for i, entry in enumerate(said.storeys)]
    if not storeys:
        problem = "names nothing to be scored"
        raise InputError(path, problem, 'add campaigns = ["FOLDER"] or a table [[storeys]]')
    if not said.variants:
        raise InputError(path, "field 'variants': there is none", "add a table [variants.default]")
    return ExperimentRequest(
        name=path.name,
        store=store,
        storeys=tuple(storeys),
        variants={name: _variant(path, name, base, own) for name, own in said.variants.items()},
        seeds=said.seeds,
        learnt=(
            *(learnt_from(folder / name) for name in said.train),
            *(_named(path, name) for name in said.train_names),
        ),
    )


def campaign_experiment(
    folder: Path,
    store: str,
    base: Settings,
    seeds: tuple[int, ...],
    building: str | None = None,
    storey: str | None = None,
) -> ExperimentRequest:
    """Return the experiment that scores a campaign with the parameters that are set.

    Parameters
    ----------
    building : str, optional
        Name its results are kept under; None: the campaign's.
    storey : str, optional
        The storey to be scored; None: all.
    """
    refuse_seeds(base, "--seeds")
    storeys = campaign_storeys(folder, building)
    chosen = tuple(s for s in storeys if storey in (None, s.storey))
    if not chosen:
        names = ", ".join(f"'{s.storey}'" for s in storeys)
        raise InputError(folder / FILE, f"has no storey '{storey}'", f"name one of {names}")
    return ExperimentRequest(
        name=folder.resolve().name,
        store=store,
        storeys=chosen,
        variants={DEFAULT: parse_params(base)},
        seeds=seeds,
    )


def campaign_storeys(folder: Path, building: str | None = None) -> list[ScoredStorey]:
    """Return the storeys of a campaign's folder, to be scored under a building's name."""
    campaign = read_campaign(folder)
    if not campaign.storeys:
        raise InputError(folder / FILE, "has no storey", "simulate the campaign again")
    return [_of_campaign(folder, building or campaign.building, s) for s in campaign.storeys]


def refuse_seeds(given: Settings, instead: str) -> None:
    """Raise MapSenseError if parameters set a seed: each repeat has its own."""
    for name in seeds_in(given):
        raise MapSenseError(
            f"setting '{name}': every repeat draws its own; leave it out, {instead} says which"
        )


def _of_campaign(folder: Path, building: str, storey: CampaignStorey) -> ScoredStorey:
    if not storey.scans:
        problem = f"storey '{storey.storey}' has no scan"
        raise InputError(folder / FILE, problem, "simulate the campaign with more --scans")
    for name in (building, storey.storey):
        _checked(folder / FILE, name)
    return ScoredStorey(
        building=building,
        storey=storey.storey,
        scans=tuple(str((folder / scan.path).resolve()) for scan in storey.scans),
        truth=str((folder / storey.truth).resolve()),
    )


def _entry(path: Path, number: int, entry: StoreyEntry) -> ScoredStorey:
    for field in ("building", "storey"):
        _checked(path, getattr(entry, field), f"field 'storeys.{number}.{field}': ")
    return ScoredStorey(
        building=entry.building,
        storey=entry.storey,
        scans=tuple(str((path.parent / scan).resolve()) for scan in entry.scans),
        truth=str((path.parent / entry.truth).resolve()),
        truth_storey=entry.truth_storey,
    )


def _variant(path: Path, name: str, base: Settings, own: Settings) -> MapSenseParams:
    _checked(path, name, "field 'variants': ")
    if name == INITIAL_MODEL or name.endswith(f".{INITIAL_MODEL}"):
        problem = f"field 'variants': '{name}' stands for a variant's initial model"
        raise InputError(path, problem, "call the variant something else")
    try:
        given = _with_grammar(merged(base, own), path.parent)
        refuse_seeds(given, "'seeds'")
        return parse_params(given)
    except MapSenseError as error:
        raise MapSenseError(f"{path}: variant '{name}': {error}") from error


def _with_grammar(given: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return parameters whose grammar, if it is none of the library, is relative to the file."""
    name = given.get("grammar")
    if not isinstance(name, str) or name in library():
        return given
    return given | {"grammar": str((folder / name).resolve())}


def _named(path: Path, name: str) -> Learnt:
    building, found, storey = name.partition("/")
    if not (building and found and storey):
        problem = f"field 'train_names': '{name}' names no storey"
        raise InputError(path, problem, "expected BUILDING/STOREY")
    return Learnt(building=building, storey=storey, source=str(path))


def _checked(path: Path, name: str, where: str = "") -> None:
    try:
        check_name(name)
    except ValueError as error:
        problem, _, remedy = str(error).partition(": ")
        raise InputError(path, where + problem, f"expected {remedy}") from error


def _read(path: Path) -> ExperimentFile:
    try:
        return ExperimentFile.model_validate(tomllib.loads(path.read_text("utf-8")))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(path, f"is no TOML ({error})", "correct it") from error
    except ValidationError as error:
        raise InputError(path, *_problem(error)) from error


def _problem(error: ValidationError) -> tuple[str, str]:
    """Return what is wrong in a file, and the remedy."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    if first["type"] != "extra_forbidden":
        return f"field '{where}': {first['msg'].lower()}", "correct it"
    model = StoreyEntry if len(first["loc"]) > 1 else ExperimentFile
    known = list(model.model_fields)
    close = get_close_matches(str(first["loc"][-1]), known, n=1)
    remedy = f"did you mean '{close[0]}'" if close else f"there are {', '.join(known)}"
    return f"unknown field '{where}'", remedy
