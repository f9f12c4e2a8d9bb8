"""The `mapsense` command: one verb per thing people do.

Only light modules are imported here: what a verb needs, it imports when it runs, so that help
answers at once.
"""

import sys

from cyclopts import App, CycloptsError

from flows.commands import asking, grammars, mapping, simulating
from flows.server import quiet
from storage.errors import MapSenseError, redacted


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
app.command(mapping.map_, name="map")
app.command(mapping.demo)
app.command(mapping.rerun)
app.command(mapping.deploy)
app.command(simulating.simulate)
app.command(simulating.energy)
app.command(simulating.train)
app.command(asking.evaluate)
app.command(asking.report)
app.command(asking.query)
app.command(asking.status)
app.command(asking.wall)
app.command(asking.prune)

grammar_app = App(name="grammar", help="Indoor grammars: learn, show and check them.")
app.command(grammar_app)
grammar_app.command(grammars.learn)
grammar_app.command(grammars.update)
grammar_app.command(grammars.show)
grammar_app.command(grammars.check)


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
    return redacted(" ".join(str(error).split()))
