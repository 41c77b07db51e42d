"""The adapter is right, and the engine is accurate in a few scenes: `pytest test_my_engine.py`, in the folder of `my_engine.py`."""

from collections.abc import Callable
from typing import Any

import pytest

import dropspin as ds


def test_adapter_conforms() -> None:
    """What `dropspin conform my_engine:MyEngine` checks."""
    results = ds.conform("my_engine:MyEngine")
    failed = [f"{result.check}: {result.message}" for result in results if result.outcome not in ("passed", "noted", "declined")]
    assert not failed, "\n".join(failed)


@pytest.mark.dropspin("drop-ball", "drop-ball-backspin", "fall-spin", engine="my_engine:MyEngine")
def test_scene(dropspin_result: Any, dropspin_check: Callable[[Any], Any]) -> None:
    """The expectations of each scene hold, and the errors vanish with the time step; the plugin of dropspin runs the scenes."""
    dropspin_check(dropspin_result)
