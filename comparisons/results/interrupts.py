"""Interrupts that leave no lock and no folder behind.

Python raises them anywhere, even between taking a lock and the statement that releases it.
"""

import signal
import threading
from collections.abc import Collection, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from types import FrameType
from typing import Any

INTERRUPTS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C, an order to end, and the end of the terminal, which Windows lacks."""


@contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Handle `INTERRUPTS` at the end of the context, which is to be short, if it runs in the main thread; others get none."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    found: list[tuple[int, FrameType | None]] = []
    handlers = {one: signal.getsignal(one) for one in INTERRUPTS}
    deferred = {one: handler for one, handler in handlers.items() if callable(handler)}
    for one in deferred:
        signal.signal(one, lambda number, frame: found.append((number, frame)))
    try:
        yield
    finally:
        for one, handler in deferred.items():
            signal.signal(one, handler)
        for number, frame in found:
            deferred[signal.Signals(number)](number, frame)


def finished(futures: "Collection[Future[Any]]", timeout: float) -> "set[Future[Any]]":
    """Those of some futures that are done, as soon as one is, or none after a time [s]; an interrupt is raised after that time."""
    with interrupts_deferred():
        return wait(futures, timeout=timeout, return_when=FIRST_COMPLETED).done
