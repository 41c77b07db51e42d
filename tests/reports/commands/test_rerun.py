"""`dropspin record rerun`: a cell of a record is measured again, and compared bit for bit. pip is replaced: no test needs a network."""

import json
import math

import pytest
from click.testing import CliRunner
from support.small_record import HOSTILE, rows, write_record

from dropspin.comparisons.record import rerun
from dropspin.comparisons.record.findings import release_of
from dropspin.comparisons.record.store import BLANK, machine
from dropspin.comparisons.running.driving import Breakdown
from dropspin.reports.commands.record_rerun import record_rerun_command
from dropspin.scenarios import DropspinError

CELL = ("mujoco[profile=default]", "3.10.0", "spin-asymmetric")
[CASE] = [row for row in rows(CELL[0], 12.7) if (row["scene"], row["dt"]) == (CELL[2], 0.001)]


@pytest.fixture
def again(tmp_path, monkeypatch):
    """Measures the cell again; the errors are `value` times the time step, or `values` with the same motions."""
    write_record(tmp_path)

    def run(*options, value=12.7, versions="mujoco 3.10.0, numpy 2.0.0", processor=None, cell=CELL, values=None):
        def measured(plan, engine, release, time_limit, stopping):
            [label], [scene] = plan.engines[engine].labels, plan.scenes_of(engine)
            assert (label, release, scene) == cell
            found = [row for row in rows(label, value) if row["scene"] == scene]
            changed = [row | {"value": one} for row, one in zip(found, values, strict=True)] if values else found
            return {"rows": changed, "versions": versions}

        monkeypatch.setattr(rerun, "measured", measured)
        monkeypatch.setattr(rerun, "machine", lambda: machine() | ({"processor": processor} if processor else {}))
        return CliRunner().invoke(record_rerun_command, [*cell, "-r", str(tmp_path), *options], standalone_mode=False)

    return run


def test_same_bits(again):
    done = again()
    assert done.return_value == 0
    assert "1 ms  0.0127" in done.stdout
    assert done.stdout.count("the same bits") == 2
    assert done.stdout.endswith(
        "Every verdict, motion and value equals that of the record, bit for bit.\nAdapter, versions and machine are those of the record.\n"
    )


def test_other_bits_and_what_differs_from_the_record(again):
    done = again(value=12.7 + 2e-3, versions="mujoco 3.10.0, numpy 2.1.0, scipy 1.0", processor="another")
    assert done.return_value == 1
    assert done.stdout.count("differs\n") == 2
    assert "At 2 of 2 time steps, the motion or the verdict differs from the record.\n" in done.stdout
    [last] = done.stdout.splitlines()[-1:]
    assert "numpy 2.1.0 (in the record: 2.0.0)" in last
    assert "scipy 1.0 (in the record: none)" in last
    assert f"processor another (in the record: {machine()['processor']})" in last


def test_other_values_of_equal_motions(again):
    done = again(values=[12.7 * 0.004, 0.0128])
    assert done.return_value == 1
    assert done.stdout.count("the same bits") == 2
    lines = done.stdout.splitlines()
    [row] = [line for line in lines if "orientation_error" in line]
    assert row.split() == ["1", "ms", "orientation_error", "[rad]", "0.0127", "0.0128"]
    assert lines[-3:-1] == [
        "Every verdict and motion equals that of the record, bit for bit.",
        "1 of 2 values of equal motions differs by more than rounding: dropspin computes these metrics otherwise than when the record was "
        "measured.",
    ]


def test_a_value_that_is_no_number_any_more_differs_and_one_that_never_was_does_not(again, monkeypatch):
    done = again(values=[12.7 * 0.004, math.nan])
    assert done.return_value == 1
    assert "0.0127    nan" in done.stdout
    monkeypatch.setattr(rerun, "_recorded", lambda *_: release_of([{**BLANK, **CASE, "value": math.nan}]))
    assert again(values=[12.7 * 0.004, math.nan]).return_value == 0


def test_values_that_another_processor_rounds_otherwise_are_counted(again):
    """A metric of a motion that is the same bit for bit may differ in its last bits."""
    done = again(values=[12.7 * 0.004, math.nextafter(0.0127, 1.0)])
    assert done.return_value == 0
    assert "\nEvery verdict and motion equals that of the record, bit for bit.\n1 of 2 values of equal motions differs by" in done.stdout
    assert "orientation_error" not in done.stdout


def test_reason_why_there_is_no_motion_in_the_record(again):
    """The small record has drop-ball as declined in 3.9.0."""
    done = again(cell=("mujoco", "3.9.0", "drop-ball"))
    assert done.return_value == 1
    assert f"In the record, declined: {HOSTILE}." in done.stdout
    assert "1 ms  declined" in done.stdout


def test_json_has_all_of_it(again):
    found = json.loads(again("--json", versions="numpy 2.1.0").stdout)
    assert [case["same"] for case in found["cases"]] == [True, True]
    assert [case["recomputed"] for case in found["cases"]] == [[], []]
    assert found["cases"][1]["now"]["values"] == {"orientation_error": 12.7 * 0.001}
    assert found["differing"] == {"numpy": {"recorded": "2.0.0", "now": "2.1.0"}}


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        (("drake", "1.0", "drop-ball"), "engine of the record 'drake' is unknown"),
        (("mujoco", "3.10.1", "drop-ball"), "3.10.1 has no results in the record: not installable"),
        (("mujoco", "3.12.0", "drop-ball"), "release of mujoco in the record '3.12.0' is unknown"),
        (("mujoco[integrator=rk4]", "3.10.0", "drop-ball"), "is unknown. Known: mujoco, mujoco[profile=default]."),
        (("mujoco", "3.10.0", "drop-box"), "Did you mean 'drop-ball'?"),
    ],
)
def test_cell_that_the_record_does_not_have(again, cell, words):
    with pytest.raises(DropspinError) as error:
        raise again(cell=cell).exception
    assert words in str(error.value)


def test_release_that_can_no_longer_be_installed(tmp_path, monkeypatch):
    write_record(tmp_path)

    def measured(*_):
        raise Breakdown("missing", "not installable: no wheel")

    monkeypatch.setattr(rerun, "measured", measured)
    with pytest.raises(DropspinError, match=r"^mujoco 3\.10\.0: not installable: no wheel\.$"):
        raise CliRunner().invoke(record_rerun_command, [*CELL, "-r", str(tmp_path)], standalone_mode=False).exception
