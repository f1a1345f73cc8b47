"""`plan`: as the command, for any problem."""

import csv
import io

import hypothesis.strategies as st
import numpy as np
import pytest
import syncline
from hypothesis import HealthCheck, given, settings


def test_a_move_in_closed_form():
    plan = syncline.plan([syncline.Axis(0, 100, vmax=200, amax=2000, jmax=40000)])
    # 100 mm at 200 mm/s, 200 mm/s at 2,000 mm/s², 2,000 mm/s² at 40,000 mm/s³.
    assert plan.duration == pytest.approx(0.5 + 0.1 + 0.05, abs=1e-12)
    (segments,) = plan.segments()
    assert np.sum(segments["duration_s"]) == pytest.approx(plan.duration)
    assert set(np.abs(segments["jerk"])) <= {0.0, 40000.0}
    rows = plan.sample(0.01)
    assert np.asarray(rows["p_0"])[-1] == pytest.approx(100)
    assert np.abs(rows["v_0"]).max() == pytest.approx(200)
    assert np.allclose(np.diff(rows["t_s"]), 0.01)


STATES = st.floats(-50, 50)
LIMITS = st.floats(1, 1000)
AXES = st.fixed_dictionaries(
    {"p0": STATES, "pf": STATES, "v0": STATES, "vf": STATES, "vmax": LIMITS, "amax": LIMITS, "jmax": LIMITS},
    optional={"a0": STATES, "vmin": LIMITS.map(lambda it: -it), "pmin": st.floats(-100, 0), "pmax": st.floats(0, 100)},
)


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.lists(AXES, min_size=1, max_size=3), st.sampled_from(["line", "time", "none"]), st.floats(0, 3))
def test_any_problem_has_the_answer_of_the_command(command, tmp_path, axes, sync, min_duration):
    cases = tmp_path / "cases.csv"
    fields = {"id": 1, "sync": sync, "min_duration": min_duration}
    for index, axis in enumerate(axes):
        full = {"a0": 0.0, "af": 0.0, "vmin": -axis["vmax"], "amin": -axis["amax"], "pmin": "", "pmax": "", **axis}
        fields |= {f"{name}_{index}": value for name, value in full.items()}
    with cases.open("w", newline="") as file:
        writer = csv.DictWriter(file, fields)
        writer.writeheader()
        writer.writerow(fields)
    (answer,) = csv.DictReader(io.StringIO(command("plan", cases, "--segments").stdout))
    problem = [syncline.Axis(**axis) for axis in axes]
    if answer["status"] != "ok":
        with pytest.raises(syncline.SynclineError):
            syncline.plan(problem, sync=sync, min_duration=min_duration)
        return
    plan = syncline.plan(problem, sync=sync, min_duration=min_duration)
    assert plan.duration == float(answer["duration"])
    for index, segments in enumerate(plan.segments()):
        pairs = [pair.split(":") for pair in answer[f"seg_{index}"].split(";") if pair]
        assert list(np.asarray(segments["duration_s"])) == [float(duration) for duration, _ in pairs]
        assert list(np.asarray(segments["jerk"])) == [float(jerk) for _, jerk in pairs]


@pytest.mark.parametrize("period", [0, -1, float("nan"), 1e-300])
def test_a_period_that_makes_no_rows_is_refused(period):
    plan = syncline.plan([syncline.Axis(0, 1, vmax=1, amax=1, jmax=1)])
    with pytest.raises(ValueError, match="period"):
        plan.sample(period)


def test_what_cannot_be_planned_is_refused():
    with pytest.raises(syncline.SynclineError, match="limit of velocity"):
        syncline.plan([syncline.Axis(0, 1, vmax=0, amax=1, jmax=1)])
    with pytest.raises(syncline.SynclineError, match="beyond"):
        syncline.Axis(0, 1e16, vmax=1, amax=1, jmax=1)
    with pytest.raises(TypeError):
        syncline.Axis(0, 1, vmax=1, amax=1, jmx=1)
    for axes, sync in [([], "time"), ([syncline.Axis(0, 1, vmax=1, amax=1, jmax=1)] * 17, "time")]:
        with pytest.raises(ValueError, match="axes"):
            syncline.plan(axes, sync=sync)
    with pytest.raises(ValueError, match="sync"):
        syncline.plan([syncline.Axis(0, 1, vmax=1, amax=1, jmax=1)], sync="both")
