"""`check`, and errors as Python has them."""

import pytest
import syncline
from conftest import ROOT, XYZ

MACHINE = XYZ / "machine.toml"


def test_what_the_input_amounts_to():
    found = syncline.check(MACHINE, XYZ / "rosette.ngc")
    assert found["axes"] == ["Z", "X", "Y"]
    assert found["program"]["blocks"] > 10 and found["program"]["length_mm"] > 100
    (bus,) = found["bus"]
    assert 0 < bus["demand_s"] < bus["cycle_s"]
    assert "program" not in syncline.check(MACHINE)


BAD_PROGRAMS = ["G1 X10\nF100\n", "G0 X1e9\nG2 X3\nG999\n", "G0 X\n", "#1=[1/0\n"]


@pytest.mark.parametrize("text", BAD_PROGRAMS)
@pytest.mark.parametrize("function", [syncline.check, syncline.validate])
def test_a_bad_program_is_told_as_by_the_command(command, tmp_path, function, text):
    part = tmp_path / "bad.ngc"
    part.write_text(text)
    done = command("check", MACHINE, part)
    with pytest.raises(syncline.SynclineError) as raised:
        function(MACHINE, part)
    assert done.returncode == 2
    assert f"error: {raised.value}\n" == done.stderr


@pytest.mark.parametrize(
    "change",
    [
        ("max_jerk", "max_jrek"),
        ("max_velocity = ", "max_velocity = -"),
        ("[machine]", "[machine"),
        ("node = 17", "node = 1700"),
    ],
)
@pytest.mark.parametrize("function", [syncline.check, syncline.validate])
def test_a_bad_machine_is_told_as_by_the_command(command, tmp_path, function, change):
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE.read_text().replace(*change))
    part = XYZ / "rosette.ngc"
    done = command("check", machine, part)
    with pytest.raises(syncline.SynclineError) as raised:
        function(machine, part)
    assert done.returncode == 2
    assert f"error: {raised.value}\n" == done.stderr


def test_a_cycle_that_does_not_fit_is_told_as_by_the_command(command, tmp_path):
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE.read_text().replace("cycle_us = 4000", "cycle_us = 1000"))
    slow = {"bus.main.bitrate": 250_000}
    fast = command("check", machine)
    assert fast.returncode == 2 and "does not fit" in fast.stderr
    with pytest.raises(syncline.SynclineError) as checked:
        syncline.check(machine)
    with pytest.raises(syncline.SynclineError) as validated:
        syncline.validate(machine, XYZ / "rosette.ngc")
    assert f"error: {checked.value}\n" == fast.stderr == f"error: {validated.value}\n"
    with pytest.raises(syncline.SynclineError) as slower:
        syncline.check(machine, set=slow)
    done = command("validate", machine, XYZ / "rosette.ngc", "--set", "bus.main.bitrate=250000")
    assert f"error: {slower.value}\n" == done.stderr


@pytest.mark.parametrize(
    "settings",
    [
        {"axis.Q.max_jerk": 1.0},
        {"axis.X.max_jerk": "much"},
        {"axis.X.max_jerk": True},
        {"axis.X.max_jerk": float("nan")},
        {"no key": 1},
        {"axis.X.nothing": [1, 2.5, "a\"b\n"]},
    ],
)
def test_a_bad_setting_is_refused(settings):
    with pytest.raises(syncline.SynclineError):
        syncline.check(MACHINE, set=settings)


@pytest.mark.parametrize("value", [None, object(), {"a": object()}, 2**70])
def test_a_setting_that_toml_does_not_know_is_a_type_error(value):
    with pytest.raises((TypeError, OverflowError, syncline.SynclineError)):
        syncline.check(MACHINE, set={"axis.X.max_jerk": value})


def test_a_missing_file_is_named():
    with pytest.raises(syncline.SynclineError, match="cannot read nowhere.toml: No such file"):
        syncline.check("nowhere.toml")
    assert (ROOT / "python/syncline.pyi").exists()
