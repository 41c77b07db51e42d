"""The processor time and the memory that an engine may use."""

from dataclasses import dataclass

from dropspin.scenarios import DropspinError

GIB = 2**30  # bytes
MOST_SECONDS, MOST_BYTES = 1e7, 2**60
WALL_TIME_FACTOR = 10.0
"""Wall time allowed over processor time allowed: an engine that sleeps forever uses no processor time."""
COMPILATION = 600.0
"""Processor time allowed for compiling, beyond that for the work [s], of an engine that compiles."""


@dataclass(frozen=True)
class ResourceLimits:
    """The processor time and memory that an engine may use for one scene at one time step, including start phases and ensemble.

    Attributes:
        processor_time: Processor time [s]. The wall time may be ten times as long.
        memory: Memory [bytes] in addition to that of the process at its start.

    Raises:
        DropspinError: A limit is not positive, or too large for the system.
    """

    processor_time: float = 300.0
    memory: int = 8 * GIB

    def __post_init__(self) -> None:
        for name, value, most in (("processor_time", self.processor_time, MOST_SECONDS), ("memory", self.memory, MOST_BYTES)):
            if not 0.0 < value <= most:
                raise DropspinError(f"{name}: got {value:g}; give a number above 0 and at most {most:g}.")


ONE_MINUTE, FIVE_MINUTES = ResourceLimits(processor_time=60.0), ResourceLimits()
"""The defaults: for a few simulations, and for a scene with all start phases."""
