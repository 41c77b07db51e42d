"""Node.js with Rapier in it, for the engine `rapier-js`: a process that takes requests of the driver's functions, and returns states.

It starts with the first simulation and ends with Python: loading Rapier takes half a second, and V8 compiles it further in the first
thousands of steps.
"""

import atexit
import json
import os
import sys
from pathlib import Path
from signal import Signals
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Array
from dropspin.comparisons.engines.packages import RAPIER_JS, npm_package

DRIVER = Path(__file__).with_suffix(".cjs")


class Node:
    """A process of Node.js that has loaded Rapier; it also ends when this process does, as its input ends then."""

    def __init__(self) -> None:
        self._process = Popen(["node", str(DRIVER)], stdin=PIPE, stdout=PIPE, stderr=DEVNULL)
        atexit.register(self.end)
        if sys.platform == "linux":
            import resource

            # WebAssembly reserves more addresses than an engine's process may; its memory is 4 GiB at most. Simulations share the process.
            for limit in (resource.RLIMIT_AS, resource.RLIMIT_CPU):
                _, most = resource.prlimit(self._process.pid, limit)
                resource.prlimit(self._process.pid, limit, (most, most))
        self.version = self.ask("load", home=str(npm_package(RAPIER_JS)))[0]["version"]

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
        """What a function of the driver returns, and states, shape (n, 13).

        Raises:
            RuntimeError: The function failed, or the process ended; then it has ended in any case.
        """
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        try:
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


_nodes: dict[int, Node] = {}
"""By the process that started it: a forked process must not share one."""


def node() -> Node:
    """This process's Node.js."""
    if os.getpid() not in _nodes or _nodes[os.getpid()].has_ended:
        _nodes[os.getpid()] = Node()
    return _nodes[os.getpid()]
