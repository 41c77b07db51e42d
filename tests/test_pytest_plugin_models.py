"""The fixture `dropspin_model`: what it says of models with findings, of bodies without a result, and of wrong arguments."""

import json
import subprocess

import pytest

from dropspin import pytest_plugin
from dropspin.comparisons.diagnosis.study import QUESTIONS, BodyDiagnosis, Diagnosis
from dropspin.reports.stories.diagnose import Diagnosed

FOUND = {"body": "cup", "question": "slide", "quantity": "stopping distance", "finding": "setting", "settings": 'cone="pyramidal"'}


@pytest.fixture
def failure(dropspin_model, monkeypatch):
    """The function from what the command ends with to the message of the test."""

    def of(code, rows, **given):
        done = subprocess.CompletedProcess([], code, stdout=json.dumps(rows), stderr="working on cup.xml\n")
        monkeypatch.setattr(pytest_plugin.Runs, "dropspin", lambda *_: done)
        with pytest.raises(pytest.fail.Exception) as failed:
            dropspin_model("cup.xml", **given)
        return str(failed.value)

    return of


def test_body_without_a_result_fails_with_the_reason(failure):
    diagnosis = Diagnosis("cup.xml", (BodyDiagnosis("cup", "mujoco", breakdown="not done after 60 s."),))
    rows = [FOUND, *json.loads(json.dumps(Diagnosed(diagnosis=diagnosis).rows()))]
    assert failure(3, rows, allowed="slide") == "cup: not done after 60 s\nReproduce: dropspin diagnose cup.xml"


def test_unknown_words_are_refused(failure):
    assert failure(0, [], allowed=["slide", "tumbl"]).startswith("allowed: got tumbl; rows begin with inertia, fall, spin, tumble,")
    assert {question.__name__ for question in QUESTIONS} - set(pytest_plugin.QUESTIONS) == {"armature", "creep", "worst_tumble"}


def test_findings_that_are_not_allowed_fail(failure):
    assert failure(0, [FOUND], allowed=["spin"]).startswith('cup, setting: slide, stopping distance: cone="pyramidal"')
