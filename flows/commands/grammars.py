"""Indoor grammars: learn, update, show and check them."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from flows.commands.options import Debug, Verbose


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
