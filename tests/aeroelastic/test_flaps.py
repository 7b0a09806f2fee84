"""Several flaps a blade: superposition, the blades' frames, the slow wake by flap, and the model's way to a file."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from flapgym.aerodynamics import build_aerodynamics, wake_transport
from flapgym.aeroelastic.blade_lattice import reduce_stacked
from flapgym.aeroelastic.build import assemble_parts, azimuth_steps, build_model, slow_wake
from flapgym.aeroelastic.coupling import couple, multiblade_aerodynamics
from flapgym.aeroelastic.equations import blade_equations, periodic_equations, turbine_equations
from flapgym.aeroelastic.transform import in_multiblade
from flapgym.aeroelastic.unequal import assemble_unequal
from flapgym.core.multiblade import to_blades
from flapgym.core.state_space import series
from flapgym.model import blade_flap_inputs, flap_inputs, load_model, save_model
from flapgym.model.nameplate import nameplate
from flapgym.model.reduced import activity, reduced_model
from flapgym.turbine import load_case
from reference.exact import harmonic_response

EDGES = (0.45, 0.6, 0.75, 0.9)


def flapped(*edges, name="nrel5mw-rated", panels=2, **blades):
    """A small case with flaps from each edge to the next, their stops apart."""
    case = load_case(name)
    flaps = (
        replace(case.flaps[0], span_start=start, span_end=end, angle_limit=0.1 + 0.02 * i)
        for i, (start, end) in enumerate(pairwise(edges))
    )
    grid = replace(case.discretisation, chordwise_panels=panels, wake_length=0.05, time_step=0.02)
    reduction = replace(case.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8)
    # A short mean wake of its own, where there is one.
    wake = {"mean_wake": 0.1, "mean_induction": 0.2} if case.airloads.mean_wake != "perturbations" else {}
    return replace(
        case,
        flaps=tuple(flaps),
        discretisation=grid,
        reduction=reduction,
        airloads=replace(case.airloads, **wake),
        blades=replace(case.blades, **blades),
    )


@pytest.fixture(scope="module")
def three():
    return build_model(flapped(*EDGES, name="nrel5mw-corrected"))


def strip_edge(case):
    """An edge of a strip somewhere on the outer blade, as a fraction of the lattice's span."""
    span = build_aerodynamics(case).lattice.span
    return float((span / span[-1])[-3])


def test_names_of_inputs():
    assert flap_inputs(1) == tuple(f"flap_{kind}_{part}" for kind in ("angle", "rate") for part in "0cs")
    assert flap_inputs(2)[:4] == ("flap1_angle_0", "flap1_angle_c", "flap1_angle_s", "flap2_angle_0")
    assert flap_inputs(3)[9:12] == ("flap1_rate_0", "flap1_rate_c", "flap1_rate_s")
    assert blade_flap_inputs(2) == ("flap1_angle", "flap2_angle", "flap1_rate", "flap2_rate")


@pytest.mark.parametrize("name", ["nrel5mw-rated", "nrel5mw-corrected"])
def test_a_flap_is_the_sum_of_its_two_halves_before_any_reduction(name):
    """Responses of turbine and blade with the lattice's own transfer function, the joint edge on a strip's."""
    edge = strip_edge(flapped(0.7, 0.9))
    whole, halves = (assemble_parts(flapped(*ends, name=name)) for ends in ((0.7, 0.9), (0.7, edge, 0.9)))
    ours, theirs = (
        harmonic_response(
            turbine_equations(parts), aero, parts.lattice, np.array([0.05, 0.7]), parts.case.rotor_speed
        )
        for parts, aero in (whole, halves)
    )
    outputs = np.abs(ours).max(axis=(0, 2), keepdims=True)
    summed = theirs[:, :, :12].reshape(*theirs.shape[:2], 2, 2, 3).sum(axis=3).reshape(*theirs.shape[:2], 6)
    np.testing.assert_allclose(ours[:, :, :6] / outputs, summed / outputs, atol=1e-11)
    np.testing.assert_allclose(
        ours[:, :, 6] / outputs[..., 0], theirs[:, :, 12] / outputs[..., 0], atol=1e-11
    )
    one, two = (blade_equations(parts).lattice_input.exogenous for parts, _ in (whole, halves))
    downwash = [parts.lattice.downwash for parts, _ in (whole, halves)]
    felt, split = downwash[0] @ one, downwash[1] @ two
    np.testing.assert_allclose(felt[:, 0], split[:, 0] + split[:, 1], atol=1e-12 * np.abs(felt).max())
    np.testing.assert_allclose(felt[:, 1], split[:, 2] + split[:, 3], atol=1e-12 * np.abs(felt).max())


def test_reduced_halves_add_up_to_the_reduced_flap_within_the_reduction():
    edge = strip_edge(flapped(0.7, 0.9))
    models = [
        build_model(replace(case, reduction=replace(case.reduction, aerodynamic_states=40)))
        for case in (flapped(0.7, 0.9), flapped(0.7, edge, 0.9))
    ]
    ours, theirs = (model.turbine.dc_gain()[:3] for model in models)
    summed, size = theirs[:, :3] + theirs[:, 3:6], np.abs(ours[:, :3]).max()
    # The reduction is exact at rest on the rotor: steady for the collective, once a turn for the others.
    np.testing.assert_allclose(summed[0], ours[0, :3], atol=1e-8 * size)
    np.testing.assert_allclose(summed[1:], ours[1:, :3], atol=1e-3 * size)


def test_three_flaps_build_with_inputs_stops_and_spans_of_each(three):
    assert three.turbine.inputs == (*flap_inputs(3), "wind")
    assert three.blade.inputs == (*blade_flap_inputs(3), "wind")
    assert [flap.name for flap in three.flaps] == ["flap1", "flap2", "flap3"]
    assert [flap.angle_limit for flap in three.flaps] == pytest.approx([0.1, 0.12, 0.14])
    spans = nameplate(three.case).flap_spans
    assert [outer for _, outer in spans[:-1]] == pytest.approx([inner for inner, _ in spans[1:]])
    # Farther out the arm is longer and the wind faster.
    lift = [three.blade.dc_gain()[0, three.blade.inputs.index(f"flap{i}_angle")] for i in (1, 2, 3)]
    assert 0.0 < lift[0] < lift[1] < lift[2]


def test_three_flaps_go_to_a_file_and_come_back_and_their_stops_are_in_the_hash(three, tmp_path):
    save_model(three, tmp_path / "three.safetensors")
    again = load_model(tmp_path / "three.safetensors")
    assert (again.flaps, again.hash, again.turbine.inputs) == (three.flaps, three.hash, three.turbine.inputs)
    other = replace(three, flaps=(*three.flaps[:2], replace(three.flaps[2], rate_limit=0.5)))
    assert other.hash != three.hash
    with pytest.raises(ValueError, match="flaps: expected the names flap1, flap2, got"):
        save_model(replace(three, flaps=(three.flaps[0], three.flaps[2])), tmp_path / "no")
    flaps = (three.flaps[0], replace(three.flaps[1], rate_limit=-1.0), three.flaps[2])
    with pytest.raises(ValueError, match=r"flaps\[1\].rate_limit: expected a number from"):
        save_model(replace(three, flaps=flaps), tmp_path / "no")
    with pytest.raises(ValueError, match=r"turbine.inputs: expected flap_angle_0"):
        save_model(replace(three, flaps=(replace(three.flaps[0], name="flap"),)), tmp_path / "no")


def test_each_flap_has_a_slow_wake_of_its_own():
    parts, _ = assemble_parts(flapped(*EDGES, name="nrel5mw-corrected"))
    felt, found = slow_wake(parts), wake_transport(parts.case, parts.flow.shed)
    gains = [found.wind.gain, *(flap.gain for flap in found.flaps)]
    inputs = ["wind", "flap1_angle_0", "flap2_angle_0", "flap3_angle_0"]
    steady = felt.dc_gain()
    place = [felt.inputs.index(name) for name in inputs]
    np.testing.assert_allclose(steady[place, place], 1.0 + np.array(gains), rtol=1e-12)
    steady[place, place] = 1.0
    np.testing.assert_array_equal(steady, np.eye(len(felt.inputs)))
    # The flap that reaches farthest in sheds far from the tip, where the cut wake is missed most.
    alone = [
        wake_transport(flapped(*ends, name="nrel5mw-corrected"), parts.flow.shed).flaps[0]
        for ends in pairwise(EDGES)
    ]
    assert found.flaps == tuple(alone)


def test_blades_of_three_flaps_in_their_own_frames_are_the_multiblade_form_at_every_azimuth():
    parts, _ = assemble_parts(flapped(*EDGES))
    periodic, still = periodic_equations(parts), turbine_equations(parts)
    for azimuth in (0.0, 1.1, 4.0):
        ours = in_multiblade(periodic(azimuth), azimuth, periodic.rotor_speed, periodic.modes)
        assert (ours.inputs, ours.outputs) == (still.inputs, still.outputs)
        given = ours.lattice_input.exogenous, still.lattice_input.exogenous
        np.testing.assert_allclose(*given, atol=1e-11 * np.abs(given[1]).max())


def test_unequal_blades_of_three_flaps_at_each_azimuth_are_equal_ones_where_they_are_equal():
    """The same parts through the way of unequal blades: states, outputs and all eighteen flap inputs."""
    case = flapped(*EDGES, name="nrel5mw-corrected")
    alike, aero = assemble_parts(case)
    components = [reduce_stacked(aero, [alike.lattice], m, 8) for m in (0, 1)]
    dt = case.discretisation.time_step
    rotor = multiblade_aerodynamics(*components, case.rotor_speed, dt)
    still = series(slow_wake(alike), couple(turbine_equations(alike), rotor, dt))
    unequal, _ = assemble_unequal(case)
    step, _ = azimuth_steps(unequal, rotor, slow_wake(unequal.mean))(1.1)
    assert step.inputs == still.inputs
    for name in "ABCD":
        ours, theirs = getattr(step, name), getattr(still, name)
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-11 * np.abs(theirs).max())


def test_a_blade_of_dead_flaps_leaves_the_collective_two_thirds():
    case = flapped(*EDGES)
    full, dead = (
        build_model(case),
        build_model(replace(case, blades=replace(case.blades, flap_effectiveness=(0.0, 1.0, 1.0)))),
    )
    assert dead.periodic is not None
    ours, theirs = (
        model.turbine.dc_gain()[model.turbine.outputs.index("tower_fore_aft")][[0, 3, 6]]
        for model in (dead, full)
    )
    np.testing.assert_allclose(ours / theirs, 2.0 / 3.0, rtol=2e-2)


def test_late_inputs_of_every_flap_are_the_prompt_ones_a_step_later():
    case = flapped(*EDGES)
    late = replace(case, discretisation=replace(case.discretisation, input_delay=1))
    ours, theirs = (build_model(each).turbine for each in (late, case))
    collective = [ours.inputs.index(name) for name in ("flap1_angle_0", "flap3_rate_0", "wind")]
    f = np.array([0.3])
    z = np.exp(2j * np.pi * f * case.discretisation.time_step)
    np.testing.assert_allclose(
        ours.frequency_response(f)[:, :, collective] * z[:, None, None],
        theirs.frequency_response(f)[:, :, collective],
        rtol=1e-6,
    )


def test_reduced_model_keeps_its_tolerance_with_three_flaps_that_each_move_by_themselves(three):
    driven = activity(three)
    covariance = driven.C @ driven.stationary_covariance() @ driven.C.T
    to_blade = np.kron(np.eye(3), to_blades(np.eye(3), 0.9).T)  # flaps, then blades
    angles = to_blade @ covariance[:9, :9] @ to_blade.T
    limits = np.repeat([0.5 * flap.angle_limit for flap in three.flaps], 3)
    np.testing.assert_allclose(angles, np.diag(limits**2), atol=1e-9)
    assert reduced_model(three, 1e-2).turbine.order < three.turbine.order
