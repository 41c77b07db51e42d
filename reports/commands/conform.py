"""`dropspin conform`."""

from typing import TYPE_CHECKING

import click

from dropspin.reports.commands.options import as_json, time_limit_option
from dropspin.reports.terminal.interrupts import stop_if_interrupted
from dropspin.reports.terminal.safe_output import echo

if TYPE_CHECKING:
    from dropspin.comparisons.conformance.outcomes import CheckResult
    from dropspin.comparisons.running.process_limits import ResourceLimits


@click.command("conform")
@click.argument("engine_name", metavar="ENGINE")
@click.option(
    "--check", "checks", multiple=True, metavar="CHECK", help="Run only this check, given by its name in the table; repeat for more."
)
@click.option("--traceback", is_flag=True, help="Print the whole traceback of each exception of the adapter.")
@time_limit_option("each check may use")
@as_json
def conform_command(engine_name: str, checks: tuple[str, ...], traceback: bool, resources: "ResourceLimits", json_output: bool) -> int:
    """Check an engine adapter against the protocol and against reference motions.

    ENGINE is a name from `dropspin list engines`, or a class of your own, such as my_module:MyEngine.

    Exit code: 0 no check failed, 1 a check failed, 2 bad input, 3 the engine crashed, hung or is not installed.
    """
    from rich.console import Console

    from dropspin.comparisons.conformance.checks import CHECKS, conform
    from dropspin.comparisons.running.engine_entries import present_entry
    from dropspin.reports.stories import conform as view
    from dropspin.reports.terminal.rows import print_json_or, print_row

    chosen, console = present_entry(engine_name).adapter, Console()
    results: list[CheckResult] = []

    def show(result: "CheckResult") -> None:
        stop_if_interrupted()
        if not json_output:
            print_row([result.check, result.outcome, view.message(result, results)], [max(map(len, CHECKS)), len("timed_out")], console)
            if traceback and result.traceback:
                echo(result.traceback)
        results.append(result)

    echo(f"checking {chosen.label}", err=True)
    conform(chosen, checks, resources=resources, on_result=show)
    keys = ("check", "outcome", "message", *(["traceback"] if traceback else []))
    print_json_or(json_output, [{key: getattr(result, key) for key in keys} for result in results], view.document(results))
    outcomes = {result.outcome for result in results}
    return 3 if outcomes & {"crashed", "timed_out"} else int("failed" in outcomes)
