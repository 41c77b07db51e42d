"""`dropspin history` in words: the runs in which results moved."""

from comparisons.regressions.history import History, Move
from reports.views.numbers import formatted, subject

MOST_RESULTS = 6
"""Results listed for one run; the table in the file has them all."""


def rows(found: History) -> list[dict[str, str]]:
    """The results that moved most, for every run in which some moved."""
    return [row for move in found.moves for row in _of_move(found, move)]


def listed(found: History) -> list[str]:
    """The same, one line each."""
    return [
        f"{row['run']} · {row['engine']} · {row['scene']}: "
        f"{row['result']} at {row['step']} from {row['before']} to {row['now']}, {row['change']}"
        for row in rows(found)
    ]


def sentences(found: History) -> list[str]:
    """What each move is attributed to."""
    moved = [
        f"{move.engine}: {len(move.results):,} results moved in {found.names[move.run]}, after {found.names[move.before]}. "
        f"{move.attribution.message[0].upper()}{move.attribution.message[1:]}."
        for move in found.moves
    ]
    scenes = found.results["scene"].nunique()
    return moved or [f"No result has moved in {len(found.names)} runs of {scenes} scenes."]


def _of_move(found: History, move: Move) -> list[dict[str, str]]:
    return [
        {
            "run": found.names[move.run],
            "engine": move.engine,
            "scene": row["scene"],
            "result": subject(row["metric"], row["kind"]),
            "step": "→ 0" if "," in row["steps"] else f"{1e3 * float(row['steps']):g} ms",
            "before": formatted(row["before"]),
            "now": formatted(row["value"]),
            "change": row["change"],
        }
        for row in move.results.head(MOST_RESULTS).to_dict("records")
    ]
