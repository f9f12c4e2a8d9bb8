"""The `mapsense` command in this process."""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO

import pytest

from flows.cli import main


def mapsense(*arguments: object) -> tuple[int, str, str]:
    """Run the command; return its exit code, stdout and stderr."""
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as left:
        main([str(argument) for argument in arguments])
    return left.value.code, out.getvalue(), err.getvalue()
