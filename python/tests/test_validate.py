"""`validate`: as the command, without copies, and with the GIL free."""

import signal
import threading
import time

import hypothesis.strategies as st
import numpy as np
import pyarrow as pa
import pytest
import syncline
from conftest import ROOT, XYZ
from hypothesis import HealthCheck, given, settings

MACHINE = XYZ / "machine.toml"


@pytest.fixture(scope="module")
def rosette():
    return syncline.validate(MACHINE, XYZ / "rosette.ngc")


@pytest.mark.parametrize(
    "machine, program",
    [
        ("xyz/machine.toml", "xyz/rosette.ngc"),
        ("portal/machine.toml", "portal/corners.ngc"),
        ("mill/machine.toml", "mill/slot.ngc"),
        ("rotary/machine.toml", "rotary/cone.ngc"),
        ("router/machine.toml", "router/frame.ngc"),
        ("csp/machine.toml", "csp/pocket.ngc"),
    ],
)
def test_the_examples_are_judged_as_by_the_command(judged, machine, program):
    machine, program = ROOT / "examples" / machine, ROOT / "examples" / program
    result = syncline.validate(machine, program, seed=3, trace=False)
    assert result.summary == judged(machine, program, "--seed", 3)
    assert len(result.summary["frames_sha256"]) == 64
    assert result.trace is None


LETTERS = st.sampled_from("XYZ")
SETTINGS = st.dictionaries(
    st.one_of(
        LETTERS.map("axis.{}.max_velocity".format),
        LETTERS.map("axis.{}.max_acceleration".format),
        LETTERS.map("axis.{}.max_jerk".format),
    ),
    st.one_of(st.integers(20, 50_000), st.floats(20, 50_000)),
    max_size=5,
)


@settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(SETTINGS, st.sampled_from(["G61", "G64"]), st.integers(0, 2**64 - 1))
def test_random_settings_are_judged_as_by_the_command(judged, part, limits, mode, seed):
    limits = {**limits, "path.mode": mode}
    options = [f"{key}={quoted(value)}" for key, value in limits.items()]
    options = [word for option in options for word in ("--set", option)]
    result = syncline.validate(MACHINE, part, set=limits, seed=seed, trace=False)
    assert result.summary == judged(MACHINE, part, *options, "--seed", seed)


def quoted(value):
    return f'"{value}"' if isinstance(value, str) else repr(value)


def test_program_stops_go_on(judged, tmp_path):
    part = tmp_path / "stops.ngc"
    part.write_text("G21\nG0 X2\nM0\nG0 X4\nM1\nT1 M6\nG0 X0\nM2\n")
    result = syncline.validate(MACHINE, part)
    assert result.verdict == "pass"
    assert result.summary == judged(MACHINE, part)


def test_tables_are_those_of_the_file(judged, tmp_path, part):
    tables = tmp_path / "shifted.toml"
    tables.write_text("[work_offsets.G54]\nX = 12.5\n")
    result = syncline.validate(MACHINE, part, tables=tables)
    assert result.summary == judged(MACHINE, part, "--tables", tables)
    moved = np.asarray(result.trace["X_set"]).max()
    assert moved == pytest.approx(12.5 + np.asarray(syncline.validate(MACHINE, part).trace["X_set"]).max())


def test_the_same_seed_gives_the_same_frames(part):
    frames = [syncline.validate(MACHINE, part, seed=seed, trace=False).summary["frames_sha256"] for seed in (0, 0, 1)]
    assert frames[0] == frames[1] != frames[2]


def test_the_rows_are_those_of_the_trace(command, rosette, tmp_path):
    file = tmp_path / "trace.csv"
    command("validate", MACHINE, XYZ / "rosette.ngc", "--trace", file)
    written = np.genfromtxt(file, delimiter=",", names=True)
    trace = rosette.trace
    for name in ["t_s", "line", "X_set", "X_act", "Y_set", "Y_act", "Z_set", "Z_act"]:
        assert np.array_equal(written[name], np.asarray(trace[name])), name


def test_the_columns_are_those_of_the_summary(rosette):
    trace, path = rosette.trace, rosette.summary["path"]
    assert np.nanmax(trace["deviation"]) == path["max_deviation_mm"]
    assert np.nanmax(trace["contour_error"]) == path["max_contour_error_mm"]
    assert trace.rows == rosette.summary["cycles"]
    for axis in rosette.summary["axes"]:
        error = np.asarray(trace[axis["name"] + "_following_error"])
        assert np.abs(error).max() == axis["max_following_error_mm"]
        velocity = np.asarray(trace[axis["name"] + "_velocity"])
        assert np.abs(velocity).max() <= axis["max_velocity"] <= axis["velocity_limit"]
    assert trace.units["X_jerk"] == "mm/s³"


def test_numpy_and_arrow_look_at_the_same_memory(rosette):
    table = pa.table(rosette.trace)
    assert table.num_rows == rosette.trace.rows
    for name in rosette.trace:
        column = rosette.trace[name]
        seen = np.asarray(column)
        address = seen.__array_interface__["data"][0]
        assert address == column.__array_interface__["data"][0]
        assert address == pa.array(column).buffers()[1].address
        (chunk,) = table[name].chunks
        assert address == chunk.buffers()[1].address
        assert np.array_equal(seen, chunk.to_numpy(), equal_nan=True)
        assert table.schema.field(name).metadata[b"unit"].decode() == column.unit


def test_a_column_has_its_values_by_their_places(rosette):
    for name in ["line", "X_set"]:
        column = rosette.trace[name]
        seen = np.asarray(column)
        assert [column[at] for at in (0, 7, -1)] == [seen[0], seen[7], seen[-1]]
        assert list(column) == list(seen)
        for beyond in (len(column), -len(column) - 1):
            with pytest.raises(IndexError, match="the column has"):
                column[beyond]


def test_a_view_keeps_its_memory_and_cannot_be_written(part):
    seen = np.asarray(syncline.validate(MACHINE, part).trace["X_set"])
    table = pa.table(syncline.validate(MACHINE, part).trace)
    others = [np.full(len(seen), 7.0) for _ in range(50)]
    assert np.array_equal(seen, table["X_set"]) and seen.max() > 29
    with pytest.raises(ValueError, match="read-only"):
        seen[0] = 1.0
    del others


def test_the_gil_is_free_while_it_runs():
    counted, ends = [0], threading.Event()

    def count():
        while not ends.is_set():
            counted[0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    before, began = counted[0], time.perf_counter()
    syncline.validate(MACHINE, XYZ / "engraving.ngc", trace=False)
    took, advanced = time.perf_counter() - began, counted[0] - before
    ends.set()
    counter.join()
    # Where the GIL is held the thread counts once or twice.
    assert advanced > 3 + 50 * took, (took, advanced)


def test_two_run_at_once_and_alike(rosette):
    found = [None, None]

    def run(place):
        found[place] = syncline.validate(MACHINE, XYZ / "rosette.ngc", trace=False).summary

    threads = [threading.Thread(target=run, args=(place,)) for place in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [rosette.summary] * 2


def test_ctrl_c_stops_it(tmp_path):
    part = tmp_path / "long.ngc"
    part.write_text("G21\nF100\n" + "G1 X100\nG1 X0\n" * 5000 + "M2\n")
    timer = threading.Timer(0.5, signal.raise_signal, [signal.SIGINT])
    timer.start()
    began = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        syncline.validate(MACHINE, part, trace=False)
    assert time.perf_counter() - began < 20
