"""Ask what was found and what it cost, and keep the store small."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from flows.commands.options import Debug, Jobs, Json, Set, Store, Verbose


def evaluate(
    what: Annotated[
        Path,
        Parameter(help="A mapped plan, a campaign's folder, or a TOML file of what is compared."),
    ],
    /,
    *,
    truth: Annotated[
        Path | None,
        Parameter(
            help="What is true of a mapped plan, in its frame: GeoJSON, IFC, labelled points."
        ),
    ] = None,
    truth_storey: Annotated[
        str | None, Parameter(help="Storey of an IFC file. [default: it has one alone]")
    ] = None,
    seeds: Annotated[
        str | None,
        Parameter(help="Repeats of a campaign: how many, or which, as 0,3,7. [default: 10]"),
    ] = None,
    building: Annotated[
        str | None, Parameter(help="Building. [default: the plan's, or the campaign's]")
    ] = None,
    storey: Annotated[
        str | None, Parameter(help="Storey. [default: the plan's, or all of the campaign]")
    ] = None,
    store: Store = None,
    set_: Set = None,
    jobs: Jobs = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Score a mapped plan: rooms, corners, walls, doors, windows, furniture. Nothing is aligned.

    Without --truth, map and score a campaign, or every storey, variant and seed that a file names.
    What was computed before comes from the cache, after an interruption too.

    For example

    ```
    mapsense evaluate ring/plan.geojson --truth campaign/ring/truth.geojson
    mapsense evaluate campaign --seeds 10
    mapsense evaluate experiment.toml --json
    ```
    """
    from flows.scoring import evaluate as score

    return score(what, truth, truth_storey, building, storey, seeds, store, set_ or [], jobs, json)


def report(
    *,
    out: Annotated[Path, Parameter(help="Folder of the report.")],
    building: Annotated[str | None, Parameter(help="Only this building.")] = None,
    store: Store = None,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Draw the paper's figures from what was measured: SVG, PNG, and one page with all of them.

    For example

    ```
    mapsense report --out report
    ```
    """
    from flows.answers import make_report

    return make_report(store, out, building)


def query(
    what: Annotated[str | None, Parameter(help="Name of a query, or SQL.")] = None,
    /,
    *,
    store: Store = None,
    format: Annotated[
        Literal["table", "json", "csv", "parquet"], Parameter(help="Form of the answer.")
    ] = "table",
    out: Annotated[Path | None, Parameter(help="File of the answer. [default: stdout]")] = None,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Ask the store: a named query or SQL, read only; without either, list the named ones.

    For example

    ```
    mapsense query stage_times
    mapsense query "select building, storey, count(*) from rooms group by all"
    ```
    """
    from flows.answers import ask

    return ask(what, store, format, out)


def status(
    *,
    building: Annotated[str | None, Parameter(help="Only this building.")] = None,
    storey: Annotated[str | None, Parameter(help="Only this storey.")] = None,
    store: Store = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Show the last run of each storey: how it ended, what failed and why.

    For example

    ```
    mapsense status --building library
    ```
    """
    from flows.answers import show_status

    return show_status(building, storey, store, json)


def wall(
    wall: Annotated[
        str | None, Parameter(help="Id of the wall in the plan, as w12. [default: most doors]")
    ] = None,
    /,
    *,
    building: Annotated[str, Parameter(help="Name of the building.")],
    storey: Annotated[str, Parameter(help="Name of the storey.")],
    out: Annotated[Path, Parameter(help="File of the picture, .png or .svg.")],
    room: Annotated[
        str | None, Parameter(help="Room that looks at it, as r3. [default: its first]")
    ] = None,
    store: Store = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Draw how the doors of a wall were found: what rays saw, edges, lines, rectangles, doors.

    For example

    ```
    mapsense wall w12 --building library --storey 2 --out w12.png
    ```
    """
    from flows.panels import draw_wall

    return draw_wall(building, storey, wall, room, out, store, json)


def prune(
    *,
    building: Annotated[str | None, Parameter(help="Only this building.")] = None,
    keep_runs: Annotated[
        int, Parameter(help="Successful runs kept of each storey, verb, variant and seed.")
    ] = 1,
    older_than: Annotated[
        float | None,
        Parameter(allow_leading_hyphen=True, help="Keep all runs of so many last days."),
    ] = None,
    dry_run: Annotated[bool, Parameter(negative=(), help="Remove nothing, say what.")] = False,
    store: Store = None,
    json: Json = False,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Remove what no current result needs: artifacts, cache records, rows and records of runs.

    What the last successful run of each storey made or reused stays, and what later ones computed
    before they failed. A storey where a run goes on is left as it is. Plans stay, wherever they
    are. `query regressions` compares two runs: keep as many. Small files of measurements need no
    merging: queries read them from packs, and packs with rows that are gone are removed too.

    For example

    ```
    mapsense prune --older-than 30 --dry-run
    ```
    """
    from flows.pruning import prune_store

    return prune_store(store, building, keep_runs, older_than, dry_run, json)
