"""Where a flow's stages run: in threads of its process, or on a Dask cluster if one is set.

    # mapsense.toml
    dask = "tcp://scheduler:8786"

The same from the environment, which is what scheduled runs are told by: MAPSENSE_DASK. Nothing
else changes: keys, rows, limits and results are those of threads. How many stages run at once is
then the number of the cluster's threads; `jobs` counts for threads here only.
"""

import os
import re
import socket
from typing import Any

from prefect.task_runners import ThreadPoolTaskRunner

from flows.server import is_own
from flows.settings import default_jobs
from storage.errors import MapSenseError

DASK = "MAPSENSE_DASK"
ADDRESS = re.compile(r"(?:tcp|tls)://(?:\[([0-9a-fA-F:.]+)\]|([^\s:/\[\]]+)):(\d{1,5})")
PATIENCE_S = 10.0


def threads(jobs: int | None = None) -> Any:
    """Return a task runner of a number of threads; None: one per processor."""
    return ThreadPoolTaskRunner(max_workers=jobs or default_jobs())


def task_runner(jobs: int | None = None) -> Any:
    """Return what runs a flow's stages.

    Parameters
    ----------
    jobs : int, optional
        Threads, if no cluster is set; None: one per processor.

    Raises
    ------
    MapSenseError
        If a cluster is set but cannot be used.
    """
    address = os.environ.get(DASK, "")
    if not address:
        return threads(jobs)
    where = ADDRESS.fullmatch(address)
    if where is None or not 0 < int(where[3]) < 1 << 16:
        raise MapSenseError(
            f"setting 'dask' = '{address}': is no address of a Dask scheduler; write "
            "tcp://host:8786, or tls://host:8786"
        )
    if is_own() or not os.environ.get("PREFECT_API_URL"):
        raise MapSenseError(
            f"setting 'dask' = '{address}': stages on a cluster need a Prefect server that its "
            "workers reach; start 'prefect server start --host 0.0.0.0' and export "
            "PREFECT_API_URL=http://<this host>:4200/api, or unset dask"
        )
    try:
        from flows.cluster import ClusterTaskRunner
    except ImportError as error:
        raise MapSenseError(
            f"setting 'dask' = '{address}': package '{error.name}' is missing; install "
            "'mapsense[scale]', on the scheduler and its workers too, or unset dask"
        ) from error
    _knock(address, where[1] or where[2], int(where[3]))
    return ClusterTaskRunner(address)


def _knock(address: str, host: str, port: int) -> None:
    """Raise MapSenseError unless something listens there: Dask itself would wait for long."""
    try:
        socket.create_connection((host, port), PATIENCE_S).close()
    except OSError as error:
        raise MapSenseError(
            f"setting 'dask' = '{address}': nothing answers there ({error.strerror or error}); "
            "start 'dask scheduler', correct the address, or unset dask"
        ) from error
