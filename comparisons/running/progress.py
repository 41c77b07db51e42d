"""Progress of a run, as its callbacks receive it while engines work."""

from collections.abc import Callable
from typing import NamedTuple


class Progress(NamedTuple):
    """How far a run is with one scene, one engine and one time step.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        dt: Time step [s].
        done: Simulations done: from the start phases, and from perturbed starts.
        total: Simulations to do; 0 before the first.
        finished: Whether all is done that was asked for at this time step.
        added: Whether the time step or the engine was added to extrapolate an error, beyond what was asked for.
        timing: Whether the engine's steps are being timed, before all other work.
    """

    scene: str
    engine: str
    dt: float
    done: int = 0
    total: int = 0
    finished: bool = False
    added: bool = False
    timing: bool = False


OnProgress = Callable[[Progress], None]
OnSimulations = Callable[[int, int], None]
"""Called with the numbers of simulations done and to do."""
