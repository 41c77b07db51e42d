"""The distances of engines to the exact solutions under several laws of impacts with friction, in scenes in which these laws differ."""

from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Rows
from dropspin.reports.stories.numbers import formatted, in_ms, quantity, unit
from dropspin.scenarios.truths.impact_laws import FRICTION_LAWS, law_of


def law_rows(results: Results) -> Rows:
    """A row for each scene in which the laws differ and each engine with a motion; the law of the scene is marked by *."""
    others = results.table[results.table["kind"] == "other_law"]
    rows = []
    for _, distances in others.groupby(["scene", "engine"], sort=False):
        case = distances.iloc[:1][["scene", "engine", "dt", "metric", "unit"]]
        [first] = case.to_dict("records")
        in_force = law_of(results.scenes[first["scene"]])
        sizes = dict(zip(distances["truth"], distances["value"].abs(), strict=True))
        sizes |= dict.fromkeys([str(in_force)], float(results.measurements.merge(case)["value"].abs().max()))
        cells = {str(law): f"{formatted(sizes[law])}{' *' * (law == in_force)}" if law in sizes else "–" for law in FRICTION_LAWS}
        distance = f"{quantity(first['metric'])}{unit(first['unit'])} at {in_ms(first['dt'])}"
        rows.append({"scene": first["scene"], "engine": first["engine"], "distance": distance, **cells})
    return rows
