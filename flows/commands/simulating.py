"""Simulate crowds, charge them, and train classifiers on them."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from flows.commands.options import Debug, Jobs, Json, Set, Store, Verbose


def simulate(
    *plans: Annotated[Path, Parameter(help="Plans to scan: GeoJSON or IFC files.")],
    out: Annotated[Path, Parameter(help="Folder of the campaign.")],
    preset: Annotated[
        str | None, Parameter(help="Instead of a plan: ring, wing, or paper for both.")
    ] = None,
    storey: Annotated[str | None, Parameter(help="Storey of an IFC file. [default: all]")] = None,
    building: Annotated[str, Parameter(help="Name of the building.")] = "campaign",
    scans: Annotated[
        int | None, Parameter(help="Scans in all. [default: one a room; 105 of paper]")
    ] = None,
    seed: Annotated[int, Parameter(help="Seed of everything drawn.")] = 0,
    set_: Annotated[
        list[str] | None,
        Parameter(
            name="--set", negative=(), help="A parameter, as campaign.skill=0.5; repeatable."
        ),
    ] = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Simulate volunteers who scan the rooms of a plan, of a real building or a drawn one.

    For example

    ```
    mapsense simulate --preset paper --out campaign
    mapsense simulate office.ifc --storey "Level 2" --scans 60 --out campaign
    ```
    """
    from flows.verbs import simulate_campaign

    return simulate_campaign(plans, preset, storey, building, scans, seed, out, set_ or [], json)


def energy(
    campaign: Annotated[Path, Parameter(help="Folder that 'mapsense simulate' made.")],
    /,
    *,
    building: Annotated[
        str | None, Parameter(help="Name its results are kept under. [default: its own + .scans]")
    ] = None,
    store: Store = None,
    set_: Set = None,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Charge MapSense, GraMap and No Processing for the same scans, in simulated joules.

    Each scan is also mapped alone: whether the server can use it decides who is asked again.

    For example

    ```
    mapsense energy campaign --set energy.throughput_mbit_s=10
    ```
    """
    from flows.verbs import charge_campaign

    return charge_campaign(campaign, building, store, set_ or [], jobs, json)


def train(
    kind: Annotated[Literal["doors", "furniture"], Parameter(help="What is to be told apart.")],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(help="File of the forest. [default: the one that is used]")
    ] = None,
    work: Annotated[
        Path, Parameter(help="Folder of the simulated scans and what is made of them.")
    ] = Path("mapsense-training"),
    set_: Set = None,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Train a classifier on storeys simulated for it; scores are of storeys held back in turn.

    What an earlier training simulated and mapped is taken from the work folder.

    For example

    ```
    mapsense train doors --work training --out forest.parquet
    ```
    """
    from flows.verbs import train_classifier

    return train_classifier(kind, out, work, set_ or [], jobs, json)
