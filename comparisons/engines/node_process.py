"""Node.js with an engine in it: a process that takes requests of the functions in node_process.cjs, and returns states.

It starts with the first simulation and ends with Python: loading an engine takes up to half a second, and V8 compiles it further in the
first thousands of steps.
"""

import atexit
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from signal import Signals
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Array
from dropspin.comparisons.engines.packages import npm_package

BRIDGE = Path(__file__).with_suffix(".cjs")


class Node:
    """A process of Node.js that has loaded an engine; it also ends when this process does, as its input ends then.

    Args:
        driver: The file that builds worlds of the engine.
        home: The folder of the engine's package.
    """

    def __init__(self, driver: Path, home: Path) -> None:
        self._process = Popen(["node", str(BRIDGE)], stdin=PIPE, stdout=PIPE, stderr=DEVNULL)
        atexit.register(self.end)
        if sys.platform == "linux":
            import resource

            # WebAssembly reserves more addresses than an engine's process may; its memory is 4 GiB at most. Simulations share the process.
            for limit in (resource.RLIMIT_AS, resource.RLIMIT_CPU):
                _, most = resource.prlimit(self._process.pid, limit)
                resource.prlimit(self._process.pid, limit, (most, most))
        self.version = self.ask("load", driver=str(driver), home=str(home))[0]["version"]

    @property
    def pid(self) -> int:
        """The identifier of the process."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether another process is needed."""
        return self._process.poll() is not None

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def ask(self, todo: str, **given: Any) -> tuple[dict[str, Any], Array]:
        """What a function of the bridge returns, and states, shape (n, 13).

        Raises:
            RuntimeError: The function failed, or the process ended; then it has ended in any case.
        """
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        try:
            with suppress(BrokenPipeError):  # of a process that has ended: it gives no answer
                requests.write(json.dumps({"todo": todo, **given}).encode() + b"\n")
                requests.flush()
            answer = json.loads(answers.readline() or b"{}")
            packed = answers.read(answer.get("bytes", 0))
            if "error" in answer:
                raise RuntimeError(answer["error"])
            if len(packed) < answer.get("bytes", 1):
                code = self._process.wait()
                raise RuntimeError(f"Node.js ended with {Signals(-code).name if code < 0 else f'exit code {code}'}")
            return answer, np.frombuffer(packed).reshape(-1, 13)
        except BaseException:  # an answer that was not read would be taken for the next one
            self.end()
            raise


_nodes: dict[tuple[int, Path], Node] = {}
"""By the process that started it, because a forked process must not share one, and by driver."""


def node(driver: Path, package: str) -> Node:
    """This process's Node.js with a package of npm, driven by a file.

    Raises:
        PackageNotFoundError: The package is not installed.
    """
    key = os.getpid(), driver
    if key not in _nodes or _nodes[key].has_ended:
        _nodes[key] = Node(driver, npm_package(package))
    return _nodes[key]
