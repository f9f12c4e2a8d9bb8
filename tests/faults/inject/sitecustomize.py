"""Python loads this at its start where its folder is on PYTHONPATH: it makes a scan poisonous.

A worker process that opens a file called `hangs.*` hangs in one native call that never lets Python
run, as a reader might that meets a file made to do so.
"""

import re
import sys
from pathlib import Path


def _hang(event: str, arguments: tuple) -> None:
    if event == "open" and Path(str(arguments[0])).stem == "hangs":
        re.match(r"(a+)+b", "a" * 60)


if "tasks.stage.apart" in sys.orig_argv:
    sys.addaudithook(_hang)
