"""The output of `dropspin conform`: a row for each check, and the outcome. An error message that several checks share is printed once."""

from collections import Counter
from collections.abc import Sequence

from dropspin.comparisons.conformance.outcomes import CheckResult
from dropspin.reports.views.numbers import failing
from dropspin.scenarios.text import counted

WRONG = frozenset({"failed", "crashed", "timed_out"})


def message(result: CheckResult, earlier: Sequence[CheckResult]) -> str:
    """The message of a check, or, if an earlier check has the same message, the name of that check."""
    same = [one.check for one in earlier if result.outcome in WRONG and one[1:3] == result[1:3]]
    return f"the same error as in '{same[0]}'" if same else result.message


def sentences(found: Sequence[CheckResult]) -> list[str]:
    """Sentences on error messages that several checks share, the most frequent first, and on how many checks fail."""
    wrong = [one for one in found if one.outcome in WRONG]
    errors = Counter(one.message for one in wrong)
    shared = [f"{count} checks have one error: {error}" for error, count in errors.most_common() if count > 1]
    if not wrong:
        declined = sum(one.outcome == "declined" for one in found)
        tested = f"; {declined} tested nothing, for the reasons given" if declined else ""
        return [f"{'The check does not fail' if len(found) == 1 else f'None of {len(found)} checks fails'}{tested}."]
    different = f", with {counted(len(errors), 'different message')}" if shared else ""
    return [*shared, f"{failing(len(wrong), len(found), 'check')}{different}."]
