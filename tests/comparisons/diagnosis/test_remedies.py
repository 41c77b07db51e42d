"""Which settings a finding names, and what is tried."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from support.model_files import body_of, findings_of

import dropspin as ds
from dropspin.comparisons.diagnosis.answers import DECAY_TIME, Answer, Finding, judged
from dropspin.comparisons.diagnosis.landing import rest
from dropspin.comparisons.diagnosis.remedies import answers_to
from dropspin.comparisons.diagnosis.sliding import _of_short_slide
from dropspin.comparisons.diagnosis.study import BodyDiagnosis
from dropspin.comparisons.diagnosis.xml_file import Setting
from dropspin.reports.stories.diagnose import sentences

BALL = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1"/><body name="b" pos="0 0 1"><freejoint/>
<geom type="sphere" size="0.1" mass="1" {}/></body></worldbody></mujoco>"""


class Stubborn:
    """A body whose error of 20 % no setting and no time step changes; it remembers the time steps."""

    dt, unknown, settings = 0.01, (), {}
    remedies, causes = {"cone": {"cone": "elliptic"}}, {"slide": ("cone",)}

    def __init__(self):
        self.dts = []

    def tried(self, settings, dt):
        return self

    def changes(self, settings):
        return dict.fromkeys(settings, "elliptic")

    def patch(self, changes, dt):
        return f"{changes} {dt:g}"


def test_settings_without_effect_are_not_named_as_causes():
    def slide(body, dts):
        return [Answer("slide", "stopping distance", "m", measured=0.8, in_force=1.0, findings=(Finding("model", ("cone", "timestep")),))]

    [answer] = answers_to(slide, Stubborn())
    [finding] = answer.findings
    assert (finding.kind, finding.settings, finding.tried, finding.remedies) == ("model", (), ("cone", "timestep"), ())
    written = {"cone": Setting('cone="pyramidal"'), "timestep": Setting('timestep="0.01"')}
    [sentence] = sentences(BodyDiagnosis("b", "MuJoCo", answers=(answer,), settings=written))
    assert sentence.startswith("Slide, engine: stopping distance is 0.8 m instead of 1 m: not removed by a change of cone=")


def test_setting_of_a_replicate_has_its_line(tmp_path):
    body = '<body name="b" pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1" margin=".01"/></body>'
    body = body_of(tmp_path, f'<replicate count="2" offset="1 0 0">{body}</replicate>', name="b0")
    [(answer, finding)] = findings_of(body, rest)
    [sentence] = sentences(BodyDiagnosis("b0", "MuJoCo", answers=(replace(answer, findings=(finding,)),), settings=body.settings))
    assert ': margin=".01" (model.xml, line 1). Remedy, tried: <geom type="box" size=".1 .1 .1" margin="0"/> within <replicate>' in sentence


def test_setting_that_is_compiled_of_another_model_is_named_without_a_line(tmp_path):
    part = '<mujoco><worldbody><body name="b"><freejoint/><geom type="box" size=".1 .1 .1" margin=".01"/></body></worldbody></mujoco>'
    (tmp_path / "part.xml").write_text(part)
    frame = '<frame pos="0 0 1"><attach model="part" body="b" prefix="p"/></frame>'
    body = body_of(tmp_path, frame, head='<asset><model name="part" file="part.xml"/></asset>')
    [(answer, finding)] = findings_of(body, rest)
    [sentence] = sentences(BodyDiagnosis("pb", "MuJoCo", answers=(replace(answer, findings=(finding,)),), settings=body.settings))
    assert ": margin (compiled; its place in the file was not found). Remedy, tried: <geom margin=" in sentence
    assert "/> for geometry 1 of pb gives" in sentence


@pytest.mark.parametrize(("left", "settings", "remedies"), [(0.04, ("cone",), 2), (0.09, ("timestep",), 1)])
def test_setting_is_named_if_it_explains_most_of_an_error(left, settings, remedies):
    """Both the cone and a smaller time step bring an error of 11 % within 10 %."""

    class Body(Stubborn):
        error = 0.11

        def tried(self, settings, dt):
            changed = Body()
            changed.error = left if settings else 0.11
            return changed

        def elsewhere(self, dt, changes):
            return 0, True

    def slide(body, dts):
        error = min(body.error, 0.01 if dts[0] < 0.01 else 1.0)
        found = (Finding("time step", ("cone", "timestep")),) * (error > 0.1)
        return [Answer("slide", "stopping distance", "m", measured=1.0 - error, in_force=1.0, findings=found)]

    [answer] = answers_to(slide, Body())
    [finding] = answer.findings
    assert (finding.settings, len(finding.remedies)) == (settings, remedies)


def test_a_large_error_is_not_tried_at_a_million_steps_per_second():
    body = Stubborn()

    def slide(body, dts):
        body.dts += dts
        return [Answer("slide", "stopping distance", "m", measured=1e6, in_force=1.0, findings=(Finding("model", ("timestep",)),))]

    list(answers_to(slide, body))
    assert min(body.dts) == pytest.approx(1e-4)


@pytest.mark.parametrize(("value", "count"), [(0.02, 1), (math.inf, 0)])
def test_decay_that_should_not_be_is_found_where_no_exact_solution_is_known(value, count):
    body = SimpleNamespace(unknown=("frictionloss",), falls=(0.0,), armature=0.0, lifted=0.0, causes={})
    blank = Answer("spin", DECAY_TIME, "s", physical=math.inf)
    answer = judged(body, blank, [0.01], [value], [math.nan])
    assert len(answer.findings) == count


@pytest.mark.parametrize(("measured", "count"), [(1.05, 0), (1.2, 1)])
def test_short_slide_has_its_tolerance_where_no_exact_solution_is_known(measured, count):
    answer = Answer("slide", "", "m", measured=measured, physical=1.0, findings=(Finding("setting", ("frictionloss",)),))
    assert len(_of_short_slide(answer).findings) == count


@pytest.mark.parametrize(("measured", "count"), [(0.998, 0), (0.97, 1), (1.4, 0)])
def test_setting_that_changes_a_short_slide_is_named_where_the_slide_shows_it(measured, count):
    answer = Answer("slide", "", "m", measured=measured, in_force=0.98, physical=1.0, findings=(Finding("setting", ("damping",)),))
    assert len(_of_short_slide(answer).findings) == count


def test_ball_beside_the_origin_of_its_body_rolls(tmp_path):
    """About its centre of mass, it is the same ball."""
    kept = []
    for name, place in (("central", ""), ("beside", 'pos="0 0 0.03"')):
        (file := tmp_path / f"{name}.xml").write_text(BALL.format(place))
        [body] = ds.diagnose(file, "mujoco").bodies
        kept += [answer.measured for answer in body.answers if answer.question == "roll"]
        assert not [answer for answer in body.answers if answer.question == "slide"]
    central, beside = kept
    assert beside == pytest.approx(central, rel=0.01)


@pytest.mark.parametrize(("target", "text"), [({"friction": -1.0}, "friction: got -1.0"), ({"restitution": 2.0}, "restitution: got 2.0")])
def test_impossible_targets_are_refused(target, text, tmp_path):
    (tmp_path / "ball.xml").write_text(BALL.format(""))
    with pytest.raises(ds.DropspinError, match=text):
        ds.diagnose(tmp_path / "ball.xml", "mujoco", **target)
