"""The bound as a convex optimum, the duty of a flap, and the study around them."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from baselines.duty import measure_duty
from baselines.rivals import __main__ as program
from baselines.rivals import bound as module
from baselines.rivals import study as study_module
from baselines.rivals.bound import best_flap, flap_response
from baselines.rivals.contestants import PlannedFlap, tilt_and_yaw_alone
from baselines.rivals.equal_load import EqualLoad, _stationary, at_equal_load
from flapgym.control import (
    OpenLoop,
    PIDGains,
    PredictiveController,
    Weights,
    lqg_agent,
    multiblade_pid_agent,
    pid_agent,
    stationary_rms,
)
from flapgym.evaluation import Record, simulate
from flapgym.model import load_model
from tests.synthetic import synthetic_model

MODEL = synthetic_model()
BLADE = MODEL.blade.select(["flap_angle", "flap_rate"], ["rbm"])
FIERCE = Weights(30.0, 1.0, 1.0, 0.05)
PID = PIDGains(6e-8, 0.1, 0.1, 12.0, 0.8, 1.0, 2.0)


def _gusty(steps, size=2e6):
    """A load no flap can take away: slow waves of `size` and a little noise [N m]."""
    time = MODEL.time_step * np.arange(steps)
    noise = np.random.default_rng(0).standard_normal(steps)
    return size * np.sin(1.3 * time + 0.5) + 0.5 * size * np.sin(4.1 * time) + 0.02 * size * noise


def _motion(bound, hold):
    """Angle and rate at every step from the accelerations alone."""
    dt, angle, rate, found = MODEL.time_step, 0.0, 0.0, [(0.0, 0.0)]
    for acceleration in np.repeat(bound.acceleration, hold):
        angle, rate = angle + dt * rate + 0.5 * dt**2 * acceleration, rate + dt * acceleration
        found.append((angle, rate))
    return np.array(found)


@pytest.fixture(scope="module")
def bound():
    return best_flap(_gusty(800), BLADE, MODEL, 5)


def test_the_optimality_conditions_hold(bound):
    assert bound.residual < 1e-5
    assert 0.0 <= bound.gap < 1e-4


def test_the_motion_is_the_double_integrators_and_keeps_its_stops(bound):
    motion = _motion(bound, 5)
    np.testing.assert_allclose(bound.motion(5, MODEL.time_step), motion[1:], atol=1e-6)
    np.testing.assert_allclose(motion[::5, 0], bound.angle, atol=1e-6)
    np.testing.assert_allclose(motion[::5, 1], bound.rate, atol=1e-6)
    share = np.abs(motion) / [MODEL.flaps[0].angle_limit, MODEL.flaps[0].rate_limit]
    assert (share.max(axis=0) < 1.0 + 1e-5).all()
    assert share[:, 0].max() > 0.99
    assert np.abs(bound.acceleration).max() <= MODEL.flaps[0].acceleration_limit * (1.0 + 1e-6)


def test_the_moment_is_the_models_answer_to_the_motion(bound):
    free = _gusty(800)
    expected = free + BLADE.simulate(_motion(bound, 5))[1:, 0]
    np.testing.assert_allclose(bound.rbm, expected, atol=1e-4 * np.abs(free).max())


def test_where_only_the_acceleration_is_bounded_it_is_bounded_least_squares(monkeypatch):
    monkeypatch.setattr(module, "PENALTY", 0.0)
    steps, wide = (
        60,
        replace(
            MODEL, flaps=(replace(MODEL.flaps[0], angle_limit=100.0, rate_limit=1e4, acceleration_limit=2.0),)
        ),
    )
    free = _gusty(steps)
    pulses = np.empty((steps, steps))
    for k in range(steps):
        one = np.zeros(steps)
        one[k] = 2.0
        dt = MODEL.time_step
        rate = np.concatenate([[0.0], np.cumsum(one) * dt])
        angle = np.concatenate([[0.0], np.cumsum(dt * rate[:-1] + 0.5 * dt**2 * one)])
        pulses[:, k] = BLADE.simulate(np.stack([angle, rate], axis=1))[1:, 0]
    scale = np.abs(pulses).max()
    least = lsq_linear(pulses / scale, -free / scale, (-1.0, 1.0), tol=1e-13).cost * 2.0 * scale**2
    found = best_flap(free, BLADE, wide, 1)
    assert np.abs(found.acceleration).max() > 1.99
    assert np.sum(found.rbm**2) == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize(
    "agent",
    [
        pid_agent("pid", MODEL, PID),
        lqg_agent("lqg", MODEL, FIERCE),
        PredictiveController("mpc", MODEL, FIERCE),
        PredictiveController("told", MODEL, FIERCE, preview=150),
    ],
    ids=lambda agent: agent.name,
)
def test_no_controller_does_better_than_the_bound(agent):
    loose = synthetic_model(tower_coupling=0.0)
    seeds, seconds = [3, 4], 12.0
    free = simulate(OpenLoop(), loose, seeds, seconds).rbm[:, :, 0]
    theirs = np.mean(simulate(agent, loose, seeds, seconds).rbm[:, :, 0] ** 2, axis=1)
    for each, mean_square in zip(free, theirs, strict=True):
        ours = np.mean(best_flap(each, BLADE, loose, 2).rbm ** 2)
        assert ours < mean_square < np.mean(each**2)


def test_the_plan_is_played_back_as_planned():
    loose = synthetic_model(tower_coupling=0.0)
    seeds, seconds = [3, 4], 10.0
    free = simulate(OpenLoop(), loose, seeds, seconds).rbm[:, :, 0]
    plans = [best_flap(each, BLADE, loose, 5) for each in free]
    played = simulate(PlannedFlap(loose, plans, 5), loose, seeds, seconds)
    for plan, angle, rbm in zip(plans, played.flap_angle, played.rbm, strict=True):
        ends = angle[4::5, 1]
        np.testing.assert_allclose(
            ends, plan.angle[1 : ends.size + 1], atol=5e-3 * MODEL.flaps[0].angle_limit
        )
        np.testing.assert_allclose(rbm[: plan.rbm.size, 2], plan.rbm, atol=1e-2 * np.abs(free).max())


def test_the_small_response_is_the_turbines():
    model = load_model("nrel5mw-rated")
    response = flap_response(model, model.turbine)
    full = model.turbine.select(["flap_angle_0", "flap_rate_0"], ["rbm_0"])
    assert response.order < 40
    np.testing.assert_allclose(response.dc_gain()[0, 0], full.dc_gain()[0, 0], rtol=1e-9)
    low = [0.02, 0.1, 0.3, 1.0]
    ours, theirs = (each.frequency_response(low)[:, 0, 0] for each in (response, full))
    np.testing.assert_allclose(ours, theirs, rtol=5e-3)


def test_duty_of_a_harmonic_motion():
    """Angle b sin wt: travel 2 b w / pi, rate rms b w / sqrt 2, powers b^2 w^3 / pi and b^2 w / pi."""
    size, frequency, dt = 0.1, 2.0, 0.001
    time = dt * np.arange(round(20 * 2 * np.pi / frequency / dt))[None, :, None] * np.ones((1, 1, 3))
    angle, rate = size * np.sin(frequency * time), size * frequency * np.cos(frequency * time)
    empty = np.zeros(time.shape[:2])
    others = dict.fromkeys(("tower_fore_aft", "wind"), empty)
    known = {"rbm": angle, "tip_deflection": angle, "flap_angle": angle, "flap_rate": rate, "time_step": dt}
    missing = {name: empty for name in Record.__dataclass_fields__ if name not in known | others}
    duty = measure_duty(Record(**known, **others, **missing), size)
    assert duty.travel[0] == pytest.approx(2 * size * frequency / np.pi, rel=1e-3)
    assert duty.rate_rms[0] == pytest.approx(size * frequency / np.sqrt(2.0), rel=1e-3)
    assert duty.acceleration_rms[0] == pytest.approx(size * frequency**2 / np.sqrt(2.0), rel=1e-3)
    assert duty.inertial_power[0] == pytest.approx(size**2 * frequency**3 / np.pi, rel=1e-3)
    assert duty.hinge_power[0] == pytest.approx(size**2 * frequency / np.pi, rel=1e-3)
    assert duty.at_stop[0] == pytest.approx(2 * np.arccos(0.999) / np.pi, rel=0.05)


def test_at_equal_load_all_leave_the_same_moment():
    found = at_equal_load(MODEL, Weights(0.5), 0.01)
    changes = [each.rbm_change for each in found.values()]
    assert changes[0] < -0.1
    np.testing.assert_allclose(changes, changes[0], atol=1e-3)


def test_stationary_duty_is_that_of_the_simulation():
    """Lyapunov's rms, and 2 / pi of products of rms, against what the flap did in half an hour."""
    agent = pid_agent("pid", MODEL, PIDGains(3e-8, 0.1, 0.1, 12.0, 0.8, 1.0, 2.0))
    record = simulate(agent, MODEL, range(70, 88), 100.0)
    assert np.abs(record.flap_angle).max() < MODEL.flaps[0].angle_limit
    settled = replace(record, flap_angle=record.flap_angle[:, 2000:], flap_rate=record.flap_rate[:, 2000:])
    expected, ours = _stationary(stationary_rms(MODEL, agent.system), 1.0), measure_duty(settled, 1.0)
    for name in ("travel", "rate_rms", "inertial_power", "hinge_power"):
        assert getattr(ours, name).mean() == pytest.approx(getattr(expected, name), rel=0.08), name


def test_tilt_and_yaw_alone_leave_a_common_load_alone():
    alone = tilt_and_yaw_alone(multiblade_pid_agent("individual", MODEL, PID, PID))
    common = np.concatenate([[0.7] * 3, np.zeros(6), [0.6, 0.8]])
    np.testing.assert_allclose(alone.predict(common)[0], 0.0, atol=1e-9)
    unequal = np.concatenate([[0.7, 0.1, -0.4], np.zeros(6), [0.6, 0.8]])
    assert np.abs(alone.predict(unequal)[0]).max() > 0.01


def test_a_finished_batch_is_not_computed_again(tmp_path, monkeypatch, capsys):
    shipped = {"lqg": "LQG", "lqg_saturating": "LQG, stops cut it"}
    monkeypatch.setattr("baselines.rivals.contestants.SHIPPED", shipped)
    monkeypatch.setattr(study_module, "SHIPPED", shipped)
    monkeypatch.setattr("baselines.rivals.contestants.PREVIEWS", (0.2,))
    monkeypatch.setattr(study_module, "TIMED", 10.0)
    alike = dict.fromkeys(("lqg", "pd", "pid", "lqg_calm"), EqualLoad(-0.2, 0.04, 0.05, 0.04, 0.1, 0.01))
    monkeypatch.setattr(study_module, "PREVIEWS", ())
    monkeypatch.setattr(study_module, "HORIZONS", (((1, 2), ""), ((1, 1), "")))
    monkeypatch.setattr(study_module, "margins", lambda *_: np.ones(8))
    monkeypatch.setattr(study_module, "at_equal_load", lambda model, weights, noise: alike)
    arguments = ["--realisations", "2", "--duration", "10", "--output", str(tmp_path)]
    assert program.main(arguments) == 0
    first = (tmp_path / "rivals.md").read_text()
    assert "MPC, knows the stops" in first

    def never(*_):
        raise AssertionError("simulated again")

    monkeypatch.setattr(study_module, "simulate", never)
    monkeypatch.setattr("baselines.scores.simulate_together", never)
    assert program.main(arguments) == 0
    assert (tmp_path / "rivals.md").read_text() == first


@pytest.mark.parametrize(
    "arguments", [["--model", "nowhere"], ["--realisations", "1"], ["--duration", "3.0"]], ids=lambda a: a[-1]
)
def test_bad_input_costs_one_line_and_exit_code_two(arguments, tmp_path, capsys):
    assert program.main([*arguments, "--output", str(tmp_path)]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error.startswith("baselines.rivals: ")
    assert arguments[-1] in error


def test_without_its_solver_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "piqp", None)
    with pytest.raises(ImportError, match=r"pip install 'flapgym\[baselines\]'"):
        best_flap(_gusty(20), BLADE, MODEL, 5)
