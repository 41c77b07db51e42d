"""dropspin: compare rigid-body engines with exact solutions. This module is the public interface and the console command.

    import dropspin as ds

    results = ds.run("drop-ball", "mujoco", dt=[4e-3, 2e-3, 1e-3])
    results.table

Names are imported on first use, so that `import dropspin` and `dropspin --help` load neither pandas nor an engine.
"""

import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from comparisons.calibration import Calibration as Calibration
    from comparisons.calibration import calibrate as calibrate
    from comparisons.conformance.checks import conform as conform
    from comparisons.conformance.outcomes import CheckResult as CheckResult
    from comparisons.engines.base import AsBuilt as AsBuilt
    from comparisons.engines.base import BatchSimulation as BatchSimulation
    from comparisons.engines.base import Diverged as Diverged
    from comparisons.engines.base import Engine as Engine
    from comparisons.engines.base import EngineBroken as EngineBroken
    from comparisons.engines.base import EngineMissing as EngineMissing
    from comparisons.engines.base import KnownLimitation as KnownLimitation
    from comparisons.engines.base import NumericOption as NumericOption
    from comparisons.engines.base import Simulation as Simulation
    from comparisons.engines.registry import engine as engine
    from comparisons.engines.registry import engine_names as engine_names
    from comparisons.judging.error_budget import ErrorBudget as ErrorBudget
    from comparisons.judging.error_budget import error_budget as error_budget
    from comparisons.measuring.contacts import contacts as contacts
    from comparisons.measuring.metrics import METRICS as METRICS
    from comparisons.regressions.baseline import Baseline as Baseline
    from comparisons.regressions.baseline import accept as accept
    from comparisons.regressions.baseline import load_baseline as load_baseline
    from comparisons.regressions.baseline import write_baseline as write_baseline
    from comparisons.regressions.checking import check as check
    from comparisons.regressions.comparing import compare as compare
    from comparisons.regressions.history import history as history
    from comparisons.results.ensembles import ENSEMBLE_METRICS as ENSEMBLE_METRICS
    from comparisons.results.measurement import Measurement as Measurement
    from comparisons.results.results import Results as Results
    from comparisons.results.store import load_results as load_results
    from comparisons.robustness.study import RobustnessStudy as RobustnessStudy
    from comparisons.robustness.study import find_limits as find_limits
    from comparisons.running.processes import ResourceLimits as ResourceLimits
    from comparisons.running.recording import simulate as simulate
    from comparisons.running.run import DEFAULT_DTS as DEFAULT_DTS
    from comparisons.running.run import measure as measure
    from comparisons.running.run import run as run
    from comparisons.sweeps.running import read_sweep as read_sweep
    from comparisons.sweeps.running import read_sweep_parts as read_sweep_parts
    from comparisons.sweeps.running import run_sweep as run_sweep
    from comparisons.sweeps.spec import load_sweep as load_sweep
    from comparisons.symmetries.study import symmetries as symmetries
    from comparisons.symmetries.twins import twins as twins
    from comparisons.tradeoff.points import TradeOff as TradeOff
    from comparisons.tradeoff.study import tradeoff as tradeoff
    from reports.run_folder import write_report as write_report
    from reports.terminal.run_table import print_table as print_table
    from scenarios.draw import draw as draw
    from scenarios.errors import DropspinError as DropspinError
    from scenarios.errors import SceneError as SceneError
    from scenarios.errors import UnknownName as UnknownName
    from scenarios.loading import load as load
    from scenarios.loading import names as _names
    from scenarios.model import Scenario as Scenario
    from scenarios.trajectory import Trajectory as Trajectory
    from scenarios.truths import truth_for as truth_for
    from scenarios.truths.truth import Truth as Truth

    scene_names = _names  # mypy exports a name that is imported as another only if it is assigned

_HOMES = {
    "comparisons.calibration": ("Calibration", "calibrate"),
    "comparisons.conformance.checks": ("conform",),
    "comparisons.conformance.outcomes": ("CheckResult",),
    "comparisons.engines.base": (
        "AsBuilt",
        "BatchSimulation",
        "Diverged",
        "Engine",
        "EngineBroken",
        "EngineMissing",
        "KnownLimitation",
        "NumericOption",
        "Simulation",
    ),
    "comparisons.engines.registry": ("engine", "engine_names"),
    "comparisons.judging.error_budget": ("ErrorBudget", "error_budget"),
    "comparisons.measuring.contacts": ("contacts",),
    "comparisons.measuring.metrics": ("METRICS",),
    "comparisons.regressions.baseline": ("Baseline", "accept", "load_baseline", "write_baseline"),
    "comparisons.regressions.checking": ("check",),
    "comparisons.regressions.comparing": ("compare",),
    "comparisons.regressions.history": ("history",),
    "comparisons.results.ensembles": ("ENSEMBLE_METRICS",),
    "comparisons.results.measurement": ("Measurement",),
    "comparisons.results.results": ("Results",),
    "comparisons.results.store": ("load_results",),
    "comparisons.robustness.study": ("RobustnessStudy", "find_limits"),
    "comparisons.running.processes": ("ResourceLimits",),
    "comparisons.running.recording": ("simulate",),
    "comparisons.running.run": ("DEFAULT_DTS", "measure", "run"),
    "comparisons.sweeps.running": ("read_sweep", "read_sweep_parts", "run_sweep"),
    "comparisons.sweeps.spec": ("load_sweep",),
    "comparisons.symmetries.study": ("symmetries",),
    "comparisons.symmetries.twins": ("twins",),
    "comparisons.tradeoff.points": ("TradeOff",),
    "comparisons.tradeoff.study": ("tradeoff",),
    "reports.run_folder": ("write_report",),
    "reports.terminal.run_table": ("print_table",),
    "scenarios.draw": ("draw",),
    "scenarios.errors": ("DropspinError", "SceneError", "UnknownName"),
    "scenarios.loading": ("load", ("scene_names", "names")),
    "scenarios.model": ("Scenario",),
    "scenarios.trajectory": ("Trajectory",),
    "scenarios.truths": ("truth_for",),
    "scenarios.truths.truth": ("Truth",),
}
_LOCATIONS = {
    public: (module, home)
    for module, names in _HOMES.items()
    for public, home in ((name, name) if isinstance(name, str) else name for name in names)
}
"""For each public name, the module that defines it, and its name there."""

__all__ = sorted(_LOCATIONS)  # noqa: PLE0605 - a list of strings, computed


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _LOCATIONS:
        raise AttributeError(f"module 'dropspin' has no attribute {name!r}")
    module, home = _LOCATIONS[name]
    globals()[name] = found = getattr(import_module(module), home)
    return found


def __dir__() -> list[str]:
    return __all__


def main() -> None:
    """Run the command line.

    Neither the working directory nor a user's folder on PYTHONPATH can hide dropspin's modules or installed packages. The working directory
    is on Python's path only in the processes of the user's own engines, and folders on PYTHONPATH come last.
    """
    with suppress(FileNotFoundError):  # of a working directory that was removed, which the command line reports
        _arrange_path()
    from reports.commands.main import main as command_line

    command_line()


def _arrange_path() -> None:
    home, here = os.path.dirname(os.path.abspath(__file__)), os.getcwd()
    named = [os.path.abspath(place) for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place]
    own = [place for place in sys.path if os.path.abspath(place) not in {*named, here} - {home}]
    sys.path[:] = own + [place for place in dict.fromkeys(named) if place not in {home, here}]


if __name__ == "__main__":
    main()
