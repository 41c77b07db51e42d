"""The files with the settings of engines: numbers in their texts are those of the adapters' code, whose engines need not be installed."""

import re
from pathlib import Path

import pytest

from dropspin.comparisons.engines import base

HERE = Path(base.__file__).parent
IN_CODE = re.compile(r"(?:^(?:GRIPPING|STICKING)[^=\n]* = |gripping=)([\d.e]+)", re.MULTILINE)


@pytest.mark.parametrize(
    ("settings", "code"),
    [
        *((name, name) for name in ("cannon_es_engine", "dart_engine", "drake_engine", "jolt_engine", "ode_engine")),
        *((name, name) for name in ("newton_settings", "sapien_engine")),
        *((name, "rapier_scenes") for name in ("box3d_engine", "havok_engine", "rapier_engine", "rapier_js_engine")),
    ],
)
def test_friction_of_a_floor_that_grips_is_that_of_the_code(settings, code):
    [in_code] = map(float, IN_CODE.findall((HERE / f"{code}.py").read_text(encoding="utf-8")))
    stated = re.findall(r"([\d.e+]+) where the floor grips", (HERE / f"{settings}.toml").read_text(encoding="utf-8"))
    assert set(map(float, stated)) == {in_code}
