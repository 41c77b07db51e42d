"""The output of `dropspin conform`: a row for each check, and the outcome. An error message that several checks share is printed once."""

from collections import Counter
from collections.abc import Sequence

from dropspin.comparisons.conformance.outcomes import CheckResult
from dropspin.reports.document import Document, Sentences
from dropspin.reports.stories.numbers import failing
from dropspin.scenarios.text import counted

WRONG = frozenset({"failed", "crashed", "timed_out"})


def message(result: CheckResult, earlier: Sequence[CheckResult]) -> str:
    """The message of a check, or, if an earlier check has the same message, the name of that check."""
    same = [other.check for other in earlier if result.outcome in WRONG and other[1:3] == result[1:3]]
    return f"the same error as in '{same[0]}'" if same else result.message


def document(results: Sequence[CheckResult]) -> Document:
    """Sentences on error messages that several checks share, the most frequent first, and on how many checks fail."""
    errors = Counter(result.message for result in results if result.outcome in WRONG)
    declined = sum(result.outcome == "declined" for result in results)
    shared = [f"{count} checks have the same error: {error}" for error, count in errors.most_common() if count > 1]
    if errors:
        outcome = failing(errors.total(), len(results), "check")
        outcome += f", with {counted(len(errors), 'different message')}" if shared else ""
    elif len(results) == 1:
        outcome = "The check does not fail" + ("; it tested nothing, for the reason given" if declined else "")
    else:
        reasons = "the reason" if declined == 1 else "the reasons"
        outcome = f"None of {len(results)} checks fails" + (f"; {declined} tested nothing, for {reasons} given" if declined else "")
    return Document("Checks of an adapter", [Sentences([*shared, f"{outcome}."])])
