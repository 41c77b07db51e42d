"""The connection to a Dask cluster, on which studies run."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from comparisons.engines.base import EngineMissing
from scenarios import DropspinError

CONNECT_TIMEOUT, WORKER_TIMEOUT = 30.0, 120.0
"""How long to wait for a scheduler, and for its first worker [s]."""


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of a scheduler that has a worker.

    Raises:
        EngineMissing: Dask is not installed.
        DropspinError: The address is not valid, or the scheduler does not answer.
    """
    if not re.fullmatch(r"[a-z]+://[^\s:]+:\d+", scheduler):
        raise DropspinError(
            f"--scheduler {scheduler}: not a valid address; give the one that dask scheduler prints when it starts, such as tcp://host:8786."
        )
    if find_spec("distributed") is None:
        raise EngineMissing("--scheduler needs Dask, which is not installed: pip install 'dropspin[cluster]'.")
    from distributed import Client

    try:
        client = Client(scheduler, timeout=CONNECT_TIMEOUT, set_as_default=False)  # type: ignore[no-untyped-call]  # distributed has no types
    except (OSError, ValueError) as error:
        raise DropspinError(f"--scheduler {scheduler}: no scheduler answers ({error}); start one with: dask scheduler.") from None
    with client, client.as_current():
        try:
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
        except TimeoutError:
            reason = f"no worker has connected for {WORKER_TIMEOUT:g} s; start one with: dask worker {scheduler}"
            raise DropspinError(f"--scheduler {scheduler}: {reason}.") from None
        yield client
