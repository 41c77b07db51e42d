"""JUnit XML of a run's checks for CI servers: a test suite for each engine, a test case for each row that was judged."""

import math
from datetime import datetime

from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.reports.stories.failures import reproduce, what_fails
from dropspin.reports.stories.numbers import Row, outcome, step, subject

JUDGED = FAILURES | BREAKDOWNS | {"passed", "known", "limited", "declined", "missing"}


def junit_xml(results: Results, baseline: str | None = None) -> bytes:
    """The checks of a run as JUnit XML.

    Args:
        results: The run, with the rows of a check if there was one.
        baseline: The baseline file it was compared with, for the commands that reproduce failures; None if there was none.
    """
    document = JUnitXml("dropspin")
    frame = results.table.assign(broke_down=results.breakdowns)
    for engine in results.engines:
        suite = TestSuite(_printable(engine))
        suite.timestamp = datetime.fromisoformat(results.provenance["started"]).strftime("%Y-%m-%dT%H:%M:%S")
        for name, found in versions_behind(results.provenance).items():
            suite.add_property(name, found)
        rows = frame[(frame["engine"] == engine) & frame["verdict"].isin(JUDGED)]
        suite.add_testcases([_case(results, row, baseline) for row in rows.to_dict("records")])
        document.add_testsuite(suite)
    for total in ("tests", "failures", "errors", "time"):  # the library would add `skipped`, for which the schema has no place here
        setattr(document, total, sum(getattr(suite, total) for suite in document))
    return bytes(document.tostring())  # type: ignore[no-untyped-call]


def _case(results: Results, row: Row, baseline: str | None) -> TestCase:
    accepted = "accepted: " if row["kind"] == "baseline" else ""
    what = subject(row["metric"], row["kind"], row["truth"]) or "runs"
    at = "" if math.isnan(row["dt"]) else f" at {step(row['dt'])} s"
    took = row["time_per_step"] * row["steps"]
    of = _printable(f"{row['engine']}.{row['scene']}")
    case = TestCase(f"{accepted}{what}{at}", classname=of, time=0.0 if math.isnan(took) else round(took, 6))
    said = _printable(what_fails(row))
    verdict = row["verdict"]
    if verdict in FAILURES or row["broke_down"]:
        result = (Failure if verdict in FAILURES else Error)(said, verdict)
        result.text = _printable(f"{said}\nReproduce: {reproduce(results, row, baseline)}")
        case.result = [result]
    elif verdict != "passed":
        case.result = [Skipped(f"{outcome(verdict)}: {_printable(row['reason'])}")]
    return case


def _printable(text: str) -> str:
    """A text without the characters that XML cannot contain; the error message of an engine may contain such characters."""
    return "".join(sign if sign in "\n\t" or sign.isprintable() else "�" for sign in text)
