"""What is said of friction and restitution: bounds where there are bounds, and whether a value is one of the engine or of the body."""

from dropspin.comparisons.logs.fit import Estimate, LogFit, Transfer
from dropspin.comparisons.logs.log import Cause, Finding
from dropspin.reports.document import Charts, Sentences, Table
from dropspin.reports.stories.log_fit import FittedLog, interval


def estimate(parameter, has_lower, has_upper):
    return Estimate("mujoco", parameter, 0.3, 0.2 if has_lower else 0.0, 0.4 if has_upper else 1.0, has_lower, has_upper)


def test_interval_has_only_the_ends_that_the_tosses_give():
    texts = [interval(estimate("friction", *ends)) for ends in ((True, True), (True, False), (False, True), (False, False))]
    assert texts == ["0.300 (0.200 to 0.400)", "at least 0.200", "at most 0.400", "not identified"]


def test_bound_is_rounded_to_the_side_on_which_it_holds():
    bounds = [Estimate("mujoco", "friction", 0.0, 0.20071, 0.00325, *ends) for ends in ((True, False), (False, True))]
    assert list(map(interval, bounds)) == ["at least 0.200", "at most 0.004"]


def test_restitution_that_differs_is_a_setting_and_unidentified_friction_is_explained():
    different = Transfer("restitution", "mujoco", "wang", -0.158, -0.195, -0.133, "different")
    equal = Transfer("friction", "mujoco", "wang", 0.001, -0.006, 0.008, "equal")
    undecided = Transfer("restitution", "mujoco", "bullet", 0.01, -0.02, 0.04, "undecided")
    of_all = Estimate("any engine", "friction", 0.2, 0.18, 0.22, True, True)
    estimates = (estimate("friction", False, False), estimate("restitution", True, True))
    fit = LogFit(100, 8, estimates, (different, equal, undecided), of_all, {"mujoco": 0.00224}, {"broken": "out of order"})
    scale = Finding("scale", 9.6, 9.81, causes=(Cause("length scale", -0.022, {"length_scale": 0.978}),))
    study = FittedLog(recording="r.toml", findings=[scale, Finding("drag", 0.06, 0.0)], fit=fit)
    document = FittedLog.model_validate_json(study.model_dump_json()).document()
    table, charts, sentences = document.parts
    assert isinstance(charts, Charts)
    assert [(chart.x_label, chart.rows) for chart in charts.charts] == [("friction", ("mujoco",)), ("restitution", ("mujoco",))]
    assert isinstance(table, Table)
    assert table.rows == [
        {"engine": "mujoco", "friction": "not identified", "restitution": "0.300 (0.200 to 0.400)", "discrepancy": "2.24 mm"},
        {"engine": "any engine", "friction": "0.200 (0.180 to 0.220)", "restitution": "", "discrepancy": ""},
    ]
    assert isinstance(sentences, Sentences)
    text = " ".join(sentences.items)
    assert "Restitution does not transfer between mujoco and wang: it is a setting of the engine, not of the body." in text
    assert "mujoco needs 0.158 less (95 % interval of the difference: -0.195 to -0.133" in text
    assert "Friction transfers between mujoco and wang." in text
    assert "The tosses do not show that restitution transfers between mujoco and bullet: use each value only with its engine." in text
    assert "Friction is not identified with mujoco: no toss slides" in text
    assert "broken, out of order" in text
    [correct] = document.summary
    assert isinstance(correct, Sentences)
    assert correct.items[0].endswith("Remedy: length_scale = 0.978.")
    remedies = "writes corrected.toml, with each remedy that is the only one."
    assert correct.items[1:] == [f"Correct the header first: dropspin log check r.toml {remedies}"]


def test_discrepancy_that_is_large_for_the_body_is_said():
    fit = LogFit(20, 8, (estimate("friction", False, True),), (), None, {"mujoco": 0.0447}, {}, True, ("mujoco",))
    *_, sentences = FittedLog(recording="r.toml", findings=[], fit=fit).document().parts
    assert "The discrepancy with mujoco is large for the size of the body: its values may mean nothing" in " ".join(sentences.items)
