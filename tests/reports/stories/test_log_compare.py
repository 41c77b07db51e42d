"""What is said of engines beside measured tosses: of how many tosses a mean is, if not of all."""

from dropspin.comparisons.logs.compare import Error, LogComparison
from dropspin.reports.document import Paragraph, Table
from dropspin.reports.stories.log_compare import ComparedLog


def test_mean_of_fewer_tosses_has_their_number():
    means = [
        Error("mujoco", quantity, "mean", unit, 0.1, 0.02, 0.08, 0.12, 20) for quantity, unit in (("position", "1"), ("orientation", "rad"))
    ]
    errors = (*means, Error("mujoco", "rest time", "end", "s", 0.5, 0.1, 0.2, 0.9, 7))
    study = ComparedLog(recording="r.toml", findings=[], comparison=LogComparison(20, 0.1, 1e-3, errors, (), {}, (), {}))
    table, legend, *_ = study.document().parts
    assert isinstance(table, Table)
    position, _, rest_time = table.rows
    assert position["mean over the motion"] == "10.0, 8.00 to 12.0 (2.00)"
    assert rest_time["at the end"] == "0.500, 0.200 to 0.900 (0.100; 7 tosses)"
    assert isinstance(legend, Paragraph)
    assert "Means over 20 tosses" in legend.text
