"""The rotor's speed as a state: against masses by hand, power by trims, and the loop's own algebra."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic import build
from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.equations import Parts, turbine_equations
from flapgym.aeroelastic.operating import operating_case
from flapgym.aeroelastic.speed_loop import speed_law
from flapgym.aeroelastic.trim import trim
from flapgym.core.state_space import StateSpace, feedback
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support
from flapgym.turbine import load_case

RANGE = load_case("nrel5mw-range")


def coarse(case):
    """A lattice and modes that build in seconds."""
    return replace(
        case,
        discretisation=replace(case.discretisation, chordwise_panels=2, wake_length=0.05, time_step=0.02),
        reduction=replace(case.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8),
        airloads=replace(case.airloads, mean_wake=0.1, mean_induction=0.2, slow_wake="frozen"),
    )


def opened(case, monkeypatch):
    """The built model, and the turbine before its loop was closed."""
    seen = []
    close = build.with_speed_loop
    monkeypatch.setattr(
        build, "with_speed_loop", lambda turbine, *its: seen.append(turbine) or close(turbine, *its)
    )
    return build.build_model(case), seen[0]


@pytest.fixture(scope="module", params=[9.0, 17.0])
def built(request):
    with pytest.MonkeyPatch.context() as monkeypatch:
        case = coarse(operating_case(coarse(RANGE), request.param))
        yield case, *opened(case, monkeypatch)


def told(system, output, given, frequency):
    return system.select([given], [output]).frequency_response(frequency)[:, 0, 0]


def test_torque_meets_the_inertia_of_blades_hub_and_generator():
    """Without air: sections' masses times their distance from the shaft squared, the published hub and generator."""
    case, modes = RANGE, 72
    machine, blade = case.turbine, linear_blade(case.turbine, 12, case.rotor_speed)
    nothing = BladeLattice(np.zeros((11, 2 * modes + 11)), np.zeros((modes + 6, 3)), modes, flaps=1, strips=1)
    support = linear_support(machine, case.rotor_speed)
    case = replace(case, signals=replace(case.signals, wind="homogeneous"))
    parts = Parts(case, blade, support, *normal_modes(blade.mass, blade.stiffness, modes), nothing)
    equations = turbine_equations(parts)
    sections = machine.blade_sections(12)
    r = np.linspace(sections.radius[0], sections.radius[-1], 20001) * np.cos(machine.rotor.precone)
    mass = np.interp(r / np.cos(machine.rotor.precone), sections.radius, sections.mass_density)
    of_blade = np.trapezoid(mass * r**2, r) / np.cos(machine.rotor.precone)
    drive = machine.drivetrain
    by_hand = (
        3 * of_blade + machine.hub.inertia_about_shaft + drive.gearbox_ratio**2 * drive.generator_inertia
    )
    # The elements' mass is their ends' mean, and sections have an inertia of their own.
    assert equations.structure.mass[-1, -1] == pytest.approx(by_hand, rel=0.01)
    assert equations.forcing[-1, equations.inputs.index("generator_torque")] == -1.0


@pytest.mark.parametrize("built", [17.0], indirect=True)
def test_air_brakes_a_faster_rotor_as_trims_at_other_speeds_do(built):
    """Static: the change of torque between trims without drag, which the perturbations leave out.

    Above rated, where little is induced: below, trims move the wake's helix, too, and the difference is no small one.
    """
    case, _, turbine = built
    case = replace(case, airloads=replace(case.airloads, mean_wake="perturbations", profile="none"))
    point, radius, step = case.operating_point, case.turbine.rotor.radius, 0.01

    def torque(speed):
        there = replace(point, tip_speed_ratio=speed * radius / point.wind_speed)
        return trim(replace(case, operating_point=there)).loads.torque

    by_trims = (torque(case.rotor_speed + step) - torque(case.rotor_speed - step)) / (2 * step)
    model = 1.0 / turbine.select(["generator_torque"], ["rotor_speed"]).dc_gain().item()
    assert model == pytest.approx(by_trims, rel=0.15)


def test_above_rated_steady_wind_changes_pitch_and_no_speed():
    with pytest.MonkeyPatch.context() as monkeypatch:
        model, _ = opened(coarse(operating_case(coarse(RANGE), 17.0)), monkeypatch)
    gain = dict(zip(model.turbine.outputs, model.turbine.select(["wind"]).dc_gain()[:, 0], strict=True))
    assert abs(gain["rotor_speed"]) < 1e-9
    assert gain["collective_pitch"] > 0.01
    assert gain["wind_speed_estimate"] == pytest.approx(1.0)


def test_closed_turbine_is_the_open_one_under_its_law(built):
    """(1 - G K)^-1 at each frequency, from the open turbine's and the law's own responses."""
    case, model, turbine = built
    law, frequency = speed_law(case), np.array([0.02, 0.1, 0.3])
    driven = turbine.select(law.outputs).frequency_response(frequency)
    rows = [turbine.outputs.index(name) for name in ("rotor_speed", "rbm_0")]
    wind = turbine.select(["wind"]).frequency_response(frequency)[:, rows, 0]
    answer = law.frequency_response(frequency)
    for k in range(len(frequency)):
        speed, moment = (driven[k, row] @ answer[k, :, 0] for row in rows)
        expected_speed = wind[k, 0] / (1.0 - speed)
        ours = [told(model.turbine, name, "wind", frequency)[k] for name in ("rotor_speed", "rbm_0")]
        assert ours == pytest.approx([expected_speed, wind[k, 1] + moment * expected_speed], rel=1e-7)


def test_torque_of_the_law_holds_power_in_a_slow_change_of_speed():
    case = coarse(operating_case(coarse(RANGE), 17.0))
    torque = speed_law(case).select(outputs=["generator_torque"]).frequency_response([1e-5])[0, 0, 0].real
    assert torque == pytest.approx(-RANGE.speed_control.rated_power / case.rotor_speed**2, rel=1e-3)


def test_pitch_above_rated_is_that_of_rated_power():
    case = operating_case(coarse(RANGE), 17.0)
    assert trim(case).loads.power == pytest.approx(RANGE.speed_control.rated_power, rel=1e-4)


def test_feedback_is_the_sum_of_the_geometric_series():
    one = np.ones((1, 1))
    plant = StateSpace(0.5 * one, one, one, 0.0 * one, 1.0, ("u",), ("y",))
    law = StateSpace(0.0 * one, one, -0.2 * one, 0.0 * one, 1.0, ("y",), ("u",))
    closed = feedback(plant, law)
    assert closed.outputs == ("y", "u")
    # y = 2 (given + u), u = -0.2 y in the end.
    np.testing.assert_allclose(closed.dc_gain()[:, 0], [2.0 / 1.4, -0.4 / 1.4])


def test_feedback_refuses_a_law_that_answers_at_once():
    one = np.ones((1, 1))
    plant = StateSpace(0.5 * one, one, one, 0.0 * one, 1.0, ("u",), ("y",))
    law = StateSpace(0.0 * one, one, one, one, 1.0, ("y",), ("u",))
    with pytest.raises(ValueError, match="^feedback.law.D: expected zeros"):
        feedback(plant, law)
