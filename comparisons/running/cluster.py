"""The connection to a Dask cluster, on which studies run."""

import logging
import re
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from dropspin.comparisons.engines.base import EngineMissing
from dropspin.comparisons.engines.packages import install_extra
from dropspin.scenarios import DropspinError

CONNECT_TIMEOUT, WORKER_TIMEOUT = 30.0, 120.0
"""How long to wait for a scheduler, and for its first worker [s]."""
POLL = 0.1  # s


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of a scheduler that has a worker.

    Raises:
        EngineMissing: Dask is not installed.
        DropspinError: The address is not valid, or the scheduler does not answer, is lost or loses its workers during the work.
    """

    def failed(reason: str) -> DropspinError:
        return DropspinError(f"--scheduler {scheduler}: {reason}.")

    if not re.fullmatch(r"[a-z]+://[^\s:]+:\d+", scheduler):
        raise failed("not a valid address; give the one that dask scheduler prints when it starts, such as tcp://host:8786")
    if find_spec("distributed") is None:
        raise EngineMissing(f"--scheduler needs Dask, which is not installed: {install_extra('cluster')}.")
    from distributed import Client, KilledWorker, Security
    from distributed.comm.core import CommClosedError, connect
    from distributed.utils import LoopRunner

    async def greet() -> None:
        """Exchange greetings, for which `Client` would wait without end."""
        comm = await connect(scheduler, timeout=CONNECT_TIMEOUT, **Security().get_connection_args("client"))  # type: ignore[no-untyped-call]  # distributed has no types
        await comm.close()

    try:
        LoopRunner(asynchronous=False).run_sync(greet, callback_timeout=2.0 * CONNECT_TIMEOUT)  # type: ignore[no-untyped-call]
    except Exception as error:  # whatever distributed makes of the answer of another program
        is_connected = isinstance(error, TimeoutError) or not isinstance(error, OSError | ValueError)
        reason = "the program at this address does not answer as a scheduler" if is_connected else f"no scheduler answers ({error})"
        raise failed(f"{reason}; start one with: dask scheduler") from None
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what is lost is said below, in one line
    client = Client(scheduler, timeout=CONNECT_TIMEOUT, set_as_default=False)  # type: ignore[no-untyped-call]
    with client, client.as_current():
        end = time.monotonic() + WORKER_TIMEOUT
        while not client.nthreads():  # type: ignore[no-untyped-call]
            if time.monotonic() > end:
                raise failed(f"no worker has connected for {WORKER_TIMEOUT:g} s; start one with: dask worker {scheduler}")
            time.sleep(POLL)
        try:
            yield client
        except (CancelledError, OSError) as error:
            if client.status == "running" and not isinstance(error, CancelledError | CommClosedError):
                raise  # of the folder, not of the connection
            kept = "what is finished is kept, and the same command continues, that of a sweep with --resume"
            raise failed(f"the connection was lost; {kept}") from None
        except KilledWorker as error:
            raise failed(f"workers were lost again and again at the same work ({error})") from None
