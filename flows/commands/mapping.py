"""Map storeys: their scans, a demonstration, what failed once more, by the clock."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from flows.commands.options import Debug, Jobs, Json, Set, Store, Verbose
from storage.errors import MapSenseError


def map_(
    *scans: Annotated[Path, Parameter(help="Scan files, scan folders, or folders of scans.")],
    building: Annotated[str, Parameter(help="Name of the building.")],
    storey: Annotated[str, Parameter(help="Name of the storey.")],
    store: Store = None,
    out: Annotated[
        Path | None, Parameter(help="Folder of the results. [default: in the store]")
    ] = None,
    grammar: Annotated[
        str | None,
        Parameter(help="Grammar that corrects the model: a file, or a name as office."),
    ] = None,
    set_: Set = None,
    up: Annotated[
        str | None,
        Parameter(allow_leading_hyphen=True, help="The files' up: x, -x, y, -y, z, -z or a,b,c."),
    ] = None,
    scale: Annotated[float | None, Parameter(help="Metres per unit of the files.")] = None,
    crop: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True, help="Box to keep: xmin,ymin,zmin,xmax,ymax,zmax, metres."
        ),
    ] = None,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Map the scans of one storey: its rooms and walls as a plan and drawings.

    For example

    ```
    mapsense map scans/level2 --building library --storey 2 --out library-2
    ```
    """
    if not scans:
        raise MapSenseError("no scan named: mapsense map SCAN... --building B --storey S")
    box = crop.split(",") if crop else None
    if box is not None and len(box) != 6:
        raise MapSenseError(f"--crop {crop}: expected xmin,ymin,zmin,xmax,ymax,zmax, metres")
    own: dict[str, Any] = {"up": up, "scale": scale, "crop": box}
    given: dict[str, Any] = {
        "scans": {name: value for name, value in own.items() if value is not None}
    }
    if grammar is not None:
        given["grammar"] = grammar
    from flows.verbs import map_scans

    return map_scans(scans, building, storey, store, out, set_ or [], given, jobs, json)


def demo(
    *,
    out: Annotated[Path, Parameter(help="Folder of the results.")] = Path("demo"),
    store: Annotated[
        Path | None, Parameter(help="Folder of everything that is kept. [default: OUT/store]")
    ] = None,
    seed: Annotated[int, Parameter(help="Seed of the simulated storey and its scans.")] = 0,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Simulate the scans of a small storey, map them, and compare the rooms with the truth.

    For example

    ```
    mapsense demo --out demo
    ```
    """
    from flows.verbs import run_demo

    return run_demo(out, store, seed, jobs, json)


def rerun(
    *,
    building: Annotated[str | None, Parameter(help="Only this building.")] = None,
    storey: Annotated[str | None, Parameter(help="Only this storey.")] = None,
    scan: Annotated[str | None, Parameter(help="Only storeys where this scan failed.")] = None,
    stage: Annotated[str | None, Parameter(help="Only storeys where this stage failed.")] = None,
    store: Store = None,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Run again what failed, with the sources and parameters of the last run.

    What was computed before comes from the cache: only what is missing is computed.

    For example

    ```
    mapsense rerun --building library
    mapsense rerun --stage rooms
    ```
    """
    from flows.verbs import run_again

    return run_again(building, storey, scan, stage, store, jobs, json)


def deploy(
    *files: Annotated[
        Path, Parameter(help="Files of buildings, or folders of such. [default: deployments]")
    ],
    work_pool: Annotated[
        str | None, Parameter(help="Work pool of the runs. [default: that of prefect.yaml]")
    ] = None,
    prefect_file: Annotated[
        Path | None, Parameter(help="What all share. [default: prefect.yaml beside the files]")
    ] = None,
    check: Annotated[bool, Parameter(negative=(), help="Only read the files.")] = False,
    store: Store = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Register buildings with a Prefect server: mapped by the clock as new scans arrive.

    For example

    ```
    mapsense deploy deployments
    mapsense deploy deployments/north.toml --work-pool buildings
    ```
    """
    from flows.deployments import deploy as register

    return register(files, work_pool, prefect_file, store, check, json)
