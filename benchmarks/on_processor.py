"""Engines that could use a GPU, on the processor: `-e on_processor:mjx`, in a process in which no library finds a GPU."""

import os

os.environ |= {"CUDA_VISIBLE_DEVICES": "", "JAX_PLATFORMS": "cpu"}  # before an engine is imported

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.registry import engine


def __getattr__(name: str) -> type[Engine]:
    """The adapter of an engine, with `_` for `-`, whose name ends with `-cpu`."""
    if name.startswith("__"):
        raise AttributeError(name)
    adapter = type(engine(name.replace("_", "-")))
    return type(name, (adapter,), {"name": f"{adapter.name}-cpu"})
