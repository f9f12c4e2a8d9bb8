"""Options that verbs share."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

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
