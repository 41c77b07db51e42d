"""dropspin: compare rigid-body engines with exact solutions. This package is the public interface and the console command.

    import dropspin as ds

    results = ds.run("drop-ball", "mujoco", dt=[4e-3, 2e-3, 1e-3])
    results.table

Names are imported on first use, so that `import dropspin` and `dropspin --help` load neither pandas nor an engine.
"""

import ast
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dropspin.comparisons.calibration import Calibration as Calibration
    from dropspin.comparisons.calibration import calibrate as calibrate
    from dropspin.comparisons.conformance.checks import conform as conform
    from dropspin.comparisons.conformance.outcomes import CheckResult as CheckResult
    from dropspin.comparisons.diagnosis.study import Diagnosis as Diagnosis
    from dropspin.comparisons.diagnosis.study import diagnose as diagnose
    from dropspin.comparisons.engines.base import AsBuilt as AsBuilt
    from dropspin.comparisons.engines.base import BatchSimulation as BatchSimulation
    from dropspin.comparisons.engines.base import Diverged as Diverged
    from dropspin.comparisons.engines.base import Engine as Engine
    from dropspin.comparisons.engines.base import EngineBroken as EngineBroken
    from dropspin.comparisons.engines.base import EngineMissing as EngineMissing
    from dropspin.comparisons.engines.base import KnownLimitation as KnownLimitation
    from dropspin.comparisons.engines.base import OneWorld as OneWorld
    from dropspin.comparisons.engines.base import Simulation as Simulation
    from dropspin.comparisons.engines.options import NumericOption as NumericOption
    from dropspin.comparisons.engines.program_engine import ProgramEngine as ProgramEngine
    from dropspin.comparisons.engines.registry import engine as engine
    from dropspin.comparisons.engines.registry import engine_names as engine_names
    from dropspin.comparisons.engines.settings import Setting as Setting
    from dropspin.comparisons.judging.error_budget import ErrorBudget as ErrorBudget
    from dropspin.comparisons.judging.error_budget import error_budget as error_budget
    from dropspin.comparisons.limits.study import LimitsStudy as LimitsStudy
    from dropspin.comparisons.limits.study import find_limits as find_limits
    from dropspin.comparisons.logs.check import log_check as log_check
    from dropspin.comparisons.logs.compare import LogComparison as LogComparison
    from dropspin.comparisons.logs.compare import log_compare as log_compare
    from dropspin.comparisons.logs.fit import LogFit as LogFit
    from dropspin.comparisons.logs.fit import log_fit as log_fit
    from dropspin.comparisons.logs.log import Log as Log
    from dropspin.comparisons.logs.log import Toss as Toss
    from dropspin.comparisons.logs.log import load_log as load_log
    from dropspin.comparisons.measuring.contact_laws import contacts as contacts
    from dropspin.comparisons.measuring.metrics import METRICS as METRICS
    from dropspin.comparisons.regressions.baseline import Baseline as Baseline
    from dropspin.comparisons.regressions.baseline import load_baseline as load_baseline
    from dropspin.comparisons.regressions.baseline import write_baseline as write_baseline
    from dropspin.comparisons.regressions.checking import accept as accept
    from dropspin.comparisons.regressions.checking import check as check
    from dropspin.comparisons.regressions.comparing import compare as compare
    from dropspin.comparisons.regressions.history import history as history
    from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS as ENSEMBLE_METRICS
    from dropspin.comparisons.results.results import Results as Results
    from dropspin.comparisons.results.store import load_results as load_results
    from dropspin.comparisons.results.table import Measurement as Measurement
    from dropspin.comparisons.running.arguments import DEFAULT_DTS as DEFAULT_DTS
    from dropspin.comparisons.running.driving import simulate as simulate
    from dropspin.comparisons.running.process_limits import ResourceLimits as ResourceLimits
    from dropspin.comparisons.running.run import measure as measure
    from dropspin.comparisons.running.run import run as run
    from dropspin.comparisons.sweeps.folder import read_sweep as read_sweep
    from dropspin.comparisons.sweeps.folder import read_sweep_parts as read_sweep_parts
    from dropspin.comparisons.sweeps.running import run_sweep as run_sweep
    from dropspin.comparisons.sweeps.spec import load_sweep as load_sweep
    from dropspin.comparisons.symmetries.study import symmetries as symmetries
    from dropspin.comparisons.symmetries.twins import twins as twins
    from dropspin.comparisons.tradeoff.pareto import TradeOff as TradeOff
    from dropspin.comparisons.tradeoff.study import tradeoff as tradeoff
    from dropspin.reports import plots as plots
    from dropspin.reports.run_folder import write_report as write_report
    from dropspin.reports.terminal.run_table import print_table as print_table
    from dropspin.scenarios.draw import draw as draw
    from dropspin.scenarios.errors import DropspinError as DropspinError
    from dropspin.scenarios.errors import SceneError as SceneError
    from dropspin.scenarios.errors import UnknownName as UnknownName
    from dropspin.scenarios.loading import load as load
    from dropspin.scenarios.loading import names as _names
    from dropspin.scenarios.model import Scenario as Scenario
    from dropspin.scenarios.trajectory import Trajectory as Trajectory
    from dropspin.scenarios.truths import truth_for as truth_for
    from dropspin.scenarios.truths.truth import Truth as Truth

    scene_names = _names  # mypy exports a name that is imported as another only if it is assigned


def _locations() -> dict[str, tuple[str, str]]:
    """For each public name, the module that defines it, and its name there: the imports above, which are made when a name is first used."""
    with open(__file__, encoding="utf-8") as file:
        [block] = [node for node in ast.parse(file.read()).body if isinstance(node, ast.If)]
    imported = [(node.module, alias) for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    public = {str(alias.asname): (str(module), alias.name) for module, alias in imported}
    return public | {"scene_names": public.pop("_names")}


_LOCATIONS = _locations()
__all__ = sorted(_LOCATIONS)  # noqa: PLE0605 - a list of strings, computed


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name not in _LOCATIONS:
        raise AttributeError(f"module 'dropspin' has no attribute {name!r}")
    module, home = _LOCATIONS[name]
    globals()[name] = value = getattr(__import__(module, fromlist=(home,)), home)  # as `from module import home`
    return value


def __dir__() -> list[str]:
    return __all__


def main() -> None:
    """Run the command line.

    Neither the working directory nor a user's folder on PYTHONPATH can hide dropspin's modules or installed packages. The working directory
    is on Python's path only in the processes of the user's own engines, and folders on PYTHONPATH come last.
    """
    with suppress(FileNotFoundError):  # of a working directory that was removed, which the command line reports
        _arrange_path()
    from dropspin.reports.commands.main import main as command_line

    command_line()


def _arrange_path() -> None:
    home, here = os.path.dirname(os.path.dirname(os.path.abspath(__file__))), os.getcwd()
    named = [os.path.abspath(place) for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place]
    others = [place for place in sys.path if os.path.abspath(place) not in {*named, here} - {home}]
    sys.path[:] = others + [place for place in dict.fromkeys(named) if place not in {home, here}]
