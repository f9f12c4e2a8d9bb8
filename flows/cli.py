"""The `mapsense` command: one verb per thing people do.

Only light modules are imported here: what a verb needs, it imports when it runs, so that help
answers at once.
"""

import sys
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter

from flows.server import quiet
from storage.errors import MapSenseError


def _version() -> str:
    from importlib.metadata import version

    return version("mapsense")


app = App(
    name="mapsense",
    version=_version,
    help="Crowd-sourced indoor 3D scans in, accurate indoor models out.",
    help_format="markdown",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,  # main says what is kept
)

Store = Annotated[
    Path | None, Parameter(help="Folder of everything that is kept. [default: mapsense-store]")
]
Json = Annotated[bool, Parameter(negative=(), help="Answer as JSON.")]
Jobs = Annotated[int | None, Parameter(help="Stages that run at once. [default: processors]")]
Debug = Annotated[bool, Parameter(negative=(), help="Show where an error came from.")]
Verbose = Annotated[bool, Parameter(negative=(), help="Show what Prefect logs.")]
Set = Annotated[
    list[str] | None,
    Parameter(
        name="--set",
        negative=(),
        help="A parameter of a stage, as hough.gamma_cell=25; repeatable.",
    ),
]


@app.command(name="map")
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


@app.command
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


@app.command
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


@app.command
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


@app.command
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


@app.command
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


@app.command
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


grammar_app = App(name="grammar", help="Indoor grammars: learn, show and check them.")
app.command(grammar_app)


@grammar_app.command
def learn(
    *plans: Annotated[Path, Parameter(help="Known plans: GeoJSON or IFC files.")],
    out: Annotated[Path, Parameter(name=["--out", "-o"], help="File of the grammar, TOML.")],
    storey: Annotated[str | None, Parameter(help="Storey of an IFC file. [default: all]")] = None,
    name: Annotated[str | None, Parameter(help="Its name. [default: the file's]")] = None,
    building_type: Annotated[
        str, Parameter(name="--type", help="Kind of building it is for.")
    ] = "unknown",
    set_: Annotated[
        list[str] | None,
        Parameter(name="--set", negative=(), help="A parameter, as learn.spread_floor_m=0.02."),
    ] = None,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Learn a grammar from known plans of a building, or of buildings of its kind.

    For example

    ```
    mapsense grammar learn level1.geojson level3.geojson --out library.toml
    ```
    """
    from flows.grammar import learn_grammar

    return learn_grammar(plans, out, storey, name or out.stem, building_type, set_ or [])


@grammar_app.command
def update(
    grammar: Annotated[str, Parameter(help="A file, or the name of one that comes along.")],
    *plans: Annotated[Path, Parameter(help="Accepted plans: GeoJSON or IFC files.")],
    out: Annotated[Path, Parameter(name=["--out", "-o"], help="File of the updated one.")],
    weight: Annotated[float, Parameter(help="What a room of these counts for.")] = 1.0,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Update a grammar by plans that were mapped with it and accepted.

    For example

    ```
    mapsense grammar update library.toml library-2/plan.geojson --out library.toml
    ```
    """
    from flows.grammar import update_grammar

    return update_grammar(grammar, plans, out, weight)


@grammar_app.command
def show(
    grammar: Annotated[str, Parameter(help="A file, or the name of one that comes along.")],
    /,
    *,
    out: Annotated[Path | None, Parameter(help="Folder of its drawing, SVG and PNG.")] = None,
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Show a grammar's rules and how they follow each other; with --out, draw them.

    For example

    ```
    mapsense grammar show office --out office
    ```
    """
    from flows.grammar import show_grammar

    return show_grammar(grammar, out)


@grammar_app.command
def check(
    *grammars: Annotated[str, Parameter(help="Files, or names of those that come along.")],
    verbose: Verbose = False,
    debug: Debug = False,
) -> int:
    """Check grammars: what is wrong is named with file, line and field.

    For example

    ```
    mapsense grammar check library.toml
    ```
    """
    from flows.grammar import check_grammars

    return check_grammars(grammars)


@app.command
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


@app.command
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


@app.command
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


@app.command
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


@app.command
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


@app.command
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


def main(arguments: list[str] | None = None) -> None:
    """Run the command; leave with 0 only if everything asked for was done."""
    given = sys.argv[1:] if arguments is None else arguments
    quiet("--verbose" in given)
    try:
        result = app(given, exit_on_error=False, print_error=False, result_action="return_value")
    except (MapSenseError, CycloptsError) as error:
        if "--debug" in given:
            raise
        print(f"mapsense: {_sentence(error)}", file=sys.stderr)
        sys.exit(1)
    except Exception as error:
        if "--debug" in given:
            raise
        kind = type(error).__name__
        print(
            f"mapsense: unexpected {kind}: {_sentence(error)}; --debug shows where it came from",
            file=sys.stderr,
        )
        sys.exit(1)
    except KeyboardInterrupt:
        print("mapsense: interrupted; run again, what was computed is kept", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(1)
    sys.exit(result if isinstance(result, int) else 0)


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())
