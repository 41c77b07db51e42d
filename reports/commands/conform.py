"""`dropspin conform`."""

import click

from reports.commands.interrupts import stop_if_interrupted
from reports.commands.options import as_json, time_limit_option


@click.command("conform")
@click.argument("engine_name", metavar="ENGINE")
@click.option("--check", "checks", multiple=True, metavar="CHECK", help="Make this check only, by its name in the table; repeat for more.")
@time_limit_option(60.0, "each check may take")
@as_json
def conform_command(engine_name: str, checks: tuple[str, ...], time_limit: float, json_output: bool) -> int:
    """Check an engine adapter against the protocol and against reference motions.

    ENGINE is a name, as in `dropspin list engines`, or your own as my_module:MyEngine.

    Exit code: 0 every check passed, 1 a check failed, 2 bad input, 3 the engine crashed, hung or is not installed.
    """
    from comparisons.conformance.checks import conform
    from comparisons.engines.registry import engine
    from comparisons.running.processes import ResourceLimits
    from reports.terminal.progress import status
    from reports.terminal.rows import print_rows

    chosen = engine(engine_name)
    with status(f"checking {chosen.label}"):
        found = conform(chosen, checks, resources=ResourceLimits(processor_time=time_limit))
    stop_if_interrupted()
    print_rows([{"check": one.check, "outcome": one.outcome, "message": one.message} for one in found], json_output)
    outcomes = {one.outcome for one in found}
    return 3 if outcomes & {"crashed", "timed_out"} else int("failed" in outcomes)
