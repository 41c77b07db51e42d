"""Bodies of model files written for tests, and what a diagnosis finds of them."""

from dropspin.comparisons.diagnosis.mujoco_body import MuJoCoModel
from dropspin.comparisons.diagnosis.remedies import answers_to
from dropspin.comparisons.diagnosis.study import QUESTIONS

FREE = '<body name="b" pos="0 0 1"><freejoint/>{}</body>'
PLANE = '<geom name="floor" type="plane" size="1 1 .1"/>'


def body_of(tmp_path, world, option="", head="", name=None, on=None, file="model.xml"):
    text = world if world.startswith("<robot") else f"<mujoco>{head}<option {option}/><worldbody>{PLANE}{world}</worldbody></mujoco>"
    (tmp_path / file).write_text(text)
    model = MuJoCoModel(tmp_path / file, file)
    return model.body(name or model.bodies([], False)[0], on)


def ladder(body):
    return [body.dt, body.dt / 2.0, body.dt / 4.0]


def by_quantity(answers):
    return {answer.quantity: answer for answer in answers}


def findings_of(body, *questions):
    """Each finding, with its answer."""
    answers = [answer for question in questions or QUESTIONS for answer in answers_to(question, body)]
    return [(answer, finding) for answer in answers for finding in answer.findings]
