"""Inputs and outputs that a case asks for: winds by strip, edgewise and tower-base moments, deflections by station."""

from dataclasses import replace

import numpy as np
import pytest

from flapgym.aeroelastic.blade_lattice import BladeLattice
from flapgym.aeroelastic.build import assemble_parts, build_model
from flapgym.aeroelastic.equations import Parts, periodic_equations, turbine_equations
from flapgym.aeroelastic.stations import cuts
from flapgym.aeroelastic.transform import in_multiblade
from flapgym.model import load_model, save_model, strip_inputs
from flapgym.reduction import normal_modes
from flapgym.structure import Beam, Configuration, linear_blade, linear_support
from flapgym.structure.beam import tangent
from flapgym.structure.blade import blade_beam
from flapgym.structure.support import tower_beam
from flapgym.turbine import Signals, load_case

CASE = load_case("nrel5mw-rated")
MODES = 72
OUTPUTS = (
    "rbm_edge",
    "tower_base_fore_aft",
    "tower_base_side_side",
    "deflection_0",
    "deflection_40",
    "deflection_100",
)


def small(name="nrel5mw-corrected", wind="homogeneous", outputs=(), **blades):
    """A small case with the signals asked for."""
    case = load_case(name)
    wake = {"mean_wake": 0.1, "mean_induction": 0.2} if case.airloads.mean_wake != "perturbations" else {}
    return replace(
        case,
        discretisation=replace(case.discretisation, chordwise_panels=2, wake_length=0.05, time_step=0.02),
        reduction=replace(case.reduction, blade_modes=4, tower_modes=4, aerodynamic_states=8),
        airloads=replace(case.airloads, **wake),
        blades=replace(case.blades, **blades),
        signals=Signals(wind, outputs),
    )


@pytest.fixture(scope="module")
def undamped():
    """All modes of blades and support, no damping, and a made-up lattice, whose loads drive them."""
    turbine = replace(CASE.turbine, blade_damping_ratio=0.0, tower_damping_ratio=0.0)
    case = replace(
        CASE,
        turbine=turbine,
        reduction=replace(CASE.reduction, tower_modes=66),
        signals=Signals(outputs=OUTPUTS),
    )
    blade = linear_blade(turbine, 12, case.rotor_speed)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    lattice = BladeLattice(np.zeros((1, 2 * MODES + 11)), np.zeros((MODES + 6, 3)), MODES, flaps=1, strips=1)
    return Parts(case, blade, linear_support(turbine, case.rotor_speed), frequency, shape, lattice)


@pytest.fixture(scope="module")
def by_strip():
    return build_model(small(wind="by strip"))


def harmonic(equations, omega, load=None):
    """Motion and named outputs under lattice loads, random by default, at a frequency [rad/s]."""
    structure, read = equations.structure, equations.output
    s = 1j * omega
    if load is None:
        load = np.random.default_rng(5).standard_normal(structure.work.shape[1])
    dynamic = structure.mass * s**2 + structure.damping * s + structure.stiffness
    d = np.linalg.solve(dynamic, structure.work @ load)
    y = (read.acceleration * s**2 + read.velocity * s + read.position) @ d + read.load @ load
    return d, dict(zip(equations.outputs, y, strict=True))


@pytest.mark.parametrize("omega", [0.0, 1.5, 12.0])
def test_moments_on_the_foundation_are_the_lowest_element_s_elastic_reaction(undamped, omega):
    d, y = harmonic(turbine_equations(undamped), omega)
    _, shape = undamped.modal_support
    tower = tower_beam(undamped.case.turbine)
    q = (shape @ d[3 * MODES :])[: 6 * tower.elements]
    reaction = tangent(tower, tower.reference)[:6, 6:] @ q
    expected = np.array([-reaction[4], reaction[3]])  # about +y, and about -x
    ours = [y["tower_base_fore_aft"], y["tower_base_side_side"]]
    np.testing.assert_allclose(ours, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_root_moments_are_the_elastic_reaction_of_the_root_element(undamped):
    """Nodal loads on all blades alike, at rest, against what the hub holds the bent blade with."""
    blade, shape = undamped.blade, undamped.shape
    nodal = np.random.default_rng(7).standard_normal((len(blade.position) - 1, 6)) * [
        1.0,
        1.0,
        1.0,
        0.3,
        0.3,
        0.3,
    ]
    moment = nodal[:, 3:] + np.cross(blade.position[1:], nodal[:, :3])
    one = np.concatenate([shape.T @ nodal.ravel(), nodal[:, :3].sum(axis=0), moment.sum(axis=0)])
    d, y = harmonic(turbine_equations(undamped), 0.0, np.concatenate([one, np.zeros(2 * len(one))]))
    reaction = blade.root_stiffness @ shape @ d[:MODES].real
    cone = undamped.case.turbine.rotor.precone
    axes = {"rbm_0": [0.0, 1.0, 0.0], "rbm_edge_0": [np.cos(cone), 0.0, np.sin(cone)]}
    for name, axis in axes.items():
        assert y[name].real == pytest.approx(-float(np.dot(axis, reaction[3:])), rel=1e-6)


def test_deflections_by_station_run_from_the_root_to_the_tip_through_the_nodes(undamped):
    d, y = harmonic(turbine_equations(undamped), 3.0)
    cone = undamped.case.turbine.rotor.precone
    nodes = np.vstack([np.zeros((6, MODES)), undamped.shape]).reshape(-1, 6, MODES)[:, :3]
    out = np.array([np.cos(cone), 0.0, np.sin(cone)]) @ (nodes @ d[:MODES])[:, :, None]
    span = np.linalg.norm(undamped.blade.position - undamped.blade.position[0], axis=1)
    straight = undamped.case.turbine.blade_sections_12.radius
    share = (straight - straight[0]) / (straight[-1] - straight[0])
    assert span[-1] > 0.0
    assert y["deflection_0_0"] == 0.0
    assert y["deflection_40_0"] == pytest.approx(complex(np.interp(0.4, share, out[:, 0])), rel=1e-12)
    assert y["deflection_100_0"] == pytest.approx(y["tip_deflection_0"], rel=1e-12)


@pytest.mark.parametrize("omega", [0.0, 1.5, 12.0])
def test_moments_along_the_blade_are_the_elastic_moments_in_its_elements(undamped, omega):
    """Nodal loads on a bent blade: forces less inertia outboard, against what the elements there are strained by."""
    stations = (0, 2, 30, 55, 97)
    turbine, rng = undamped.case.turbine, np.random.default_rng(9)
    steady = np.zeros((13, 6))
    steady[1:] = rng.standard_normal((12, 6)) * 500.0 + [8e3, -1e3, 0.0, 0.0, 0.0, 300.0]
    blade = linear_blade(turbine, 12, undamped.case.rotor_speed, load=steady)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, MODES)
    case = replace(undamped.case, signals=Signals(outputs=tuple(f"flapwise_moment_{n}" for n in stations)))
    told = cuts(case, blade)
    assert len(told) == 4  # at the root it is the root moment
    lattice = replace(undamped.lattice, load=np.zeros((MODES + 6 + 4, 3)))
    parts = replace(undamped, case=case, blade=blade, frequency=frequency, shape=shape, lattice=lattice)
    nodal = rng.standard_normal((12, 6)) * 1e3
    moment = nodal[:, 3:] + np.cross(blade.position[1:], nodal[:, :3])
    one = [shape.T @ nodal.ravel(), nodal[:, :3].sum(axis=0), moment.sum(axis=0)]
    load = np.concatenate([*one, [cut.work @ nodal.ravel() for cut in told], np.zeros(2 * (MODES + 10))])
    d, y = harmonic(turbine_equations(parts), omega, load)
    assert y["flapwise_moment_0_0"] == y["rbm_0"]

    beam, q = blade_beam(turbine, 12), np.vstack([np.zeros((1, 6)), (shape @ d[:MODES]).reshape(12, 6)])
    inner = [y["rbm_0"]]  # which has the rotary inertia of the root node, too
    for node in range(1, 12):
        reference = Configuration(beam.reference.position[node:], beam.reference.orientation[node:])
        outboard = Beam(reference, beam.stiffness[node:], beam.mass[node:])
        strained = tangent(outboard, Configuration(blade.position[node:], blade.orientation[node:]))
        inner.append(-(strained[:6] @ q[node:].ravel())[4])
    radius = turbine.blade_sections_12.radius
    share = (radius - radius[0]) / (radius[-1] - radius[0])
    for station in stations[1:]:
        expected = complex(np.interp(station / 100.0, share, [*inner, 0.0]))
        assert y[f"flapwise_moment_{station}_0"] == pytest.approx(expected, rel=1e-6)


def test_moment_of_a_gust_falls_from_the_root_to_the_tip_and_begins_as_the_root_moment():
    stations = (0, 1, 10, 25, 50, 75, 95)
    turbine = build_model(small(outputs=tuple(f"flapwise_moment_{n}" for n in stations))).turbine
    gain = turbine.select(inputs=["wind"]).dc_gain()[:, 0]
    along = [gain[turbine.outputs.index(f"flapwise_moment_{n}_0")] for n in stations]
    assert along[0] == gain[0]
    assert along[1] == pytest.approx(gain[0], rel=0.02)
    assert (np.diff(along) < 0.0).all()
    assert 0.0 < along[-1] < 0.01 * along[0]


def test_outputs_of_every_model_come_first_and_unchanged_and_the_asked_for_in_their_order(undamped):
    plain = replace(undamped, case=replace(undamped.case, signals=Signals()))
    _, ours = harmonic(turbine_equations(undamped), 3.0)
    _, theirs = harmonic(turbine_equations(plain), 3.0)
    assert list(ours)[:8] == list(theirs)
    assert [ours[name] for name in theirs] == list(theirs.values())
    edge = ["rbm_edge_0", "rbm_edge_c", "rbm_edge_s"]
    assert list(ours)[8:14] == [*edge, "tower_base_fore_aft", "tower_base_side_side", "deflection_0_0"]


def test_model_with_further_outputs_tells_them_apart_and_goes_to_a_file(tmp_path):
    model = build_model(small(outputs=("tower_base_fore_aft", "rbm_edge")))
    assert model.blade_outputs == ("rbm", "tip_deflection", "rbm_edge")
    assert model.fixed_outputs == ("tower_fore_aft", "tower_side_side", "tower_base_fore_aft")
    save_model(model, tmp_path / "further.safetensors")
    assert load_model(tmp_path / "further.safetensors").turbine.outputs == model.turbine.outputs
    plain = build_model(small())
    assert plain.inputs_hash != model.inputs_hash
    np.testing.assert_array_equal(plain.turbine.dc_gain(), model.turbine.dc_gain()[:8])
    mixed = replace(model.turbine, outputs=("rbm_edge_0", *model.turbine.outputs[1:9], *"abc"))
    with pytest.raises(ValueError, match=r"turbine.outputs: expected rbm_0"):
        save_model(replace(model, turbine=mixed), tmp_path / "no")


@pytest.mark.parametrize("blades", [{}, {"mass_factor": (1.05, 1.0, 1.0)}])
def test_homogeneous_wind_is_the_same_wind_on_all_strips(by_strip, blades):
    """In every matrix, the moving wake's state among the others."""
    model = build_model(small(wind="by strip", **blades)) if blades else by_strip
    turbine, strips = model.turbine, model.strips
    assert turbine.inputs[7:] == strip_inputs(strips)
    assert turbine.inputs[6:10] == ("wind", "wind1_0", "wind1_c", "wind1_s")
    for matrix in (turbine.B, turbine.D):
        summed = matrix[:, 7::3].sum(axis=1)
        np.testing.assert_allclose(summed, matrix[:, 6], atol=1e-11 * np.abs(matrix[:, 6]).max())


def test_winds_by_strip_leave_all_else_as_it_is_and_cost_no_state(by_strip, tmp_path):
    plain = build_model(small())
    assert by_strip.turbine.order == plain.turbine.order
    for name in ("A", "C"):
        np.testing.assert_array_equal(getattr(by_strip.turbine, name), getattr(plain.turbine, name))
    np.testing.assert_allclose(
        by_strip.turbine.dc_gain()[:, :7], plain.turbine.dc_gain(), rtol=1e-12, atol=1e-9
    )
    save_model(by_strip, tmp_path / "strips.safetensors")
    assert load_model(tmp_path / "strips.safetensors").strips == by_strip.strips == 10


def test_winds_by_strip_of_blades_in_their_own_frames_are_those_of_the_multiblade_form():
    parts, _ = assemble_parts(small("nrel5mw-rated", "by strip"))
    periodic, still = periodic_equations(parts), turbine_equations(parts)
    for azimuth in (0.0, 1.1, 4.0):
        ours = in_multiblade(periodic(azimuth), azimuth, periodic.rotor_speed, periodic.modes)
        assert ours.inputs == still.inputs
        given = ours.lattice_input.exogenous, still.lattice_input.exogenous
        np.testing.assert_allclose(*given, atol=1e-11 * np.abs(given[1]).max())


def test_a_strip_farther_out_bends_the_root_more_until_the_tip_loses_its_lift(by_strip):
    steady = by_strip.turbine.dc_gain()[0, 7::3]
    assert (steady > 0.0).all()
    assert 5 <= int(steady.argmax()) <= 9


@pytest.mark.parametrize(
    "change, said",
    [
        ({"wind": "sheared"}, "signals.wind: expected 'homogeneous' or 'by strip', got 'sheared'"),
        ({"outputs": ("torque",)}, r"signals.outputs\[0\]: expected rbm_edge, root_torsion, "),
        (
            {"outputs": ("deflection_101",)},
            r"signals.outputs\[0\]: expected .* deflection_N or flapwise_moment_N at N percent",
        ),
        (
            {"outputs": ("rbm_edge", "rbm_edge")},
            r"signals.outputs\[1\]: expected each name once, got 'rbm_edge'",
        ),
        ({"outputs": "rbm_edge"}, "signals.outputs: expected a row of names"),
    ],
)
def test_signals_that_are_none_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        Signals(**change)


def test_what_cannot_go_together_is_refused_before_any_work():
    with pytest.raises(ValueError, match="signals.outputs: expected none with unequal blades, got rbm_edge"):
        build_model(small(outputs=("rbm_edge",), mass_factor=(1.05, 1.0, 1.0)))
    case = small(wind="by strip")
    with pytest.raises(ValueError, match="reduction.coupled_tolerance: expected 0 % with signals.wind"):
        build_model(replace(case, reduction=replace(case.reduction, coupled_tolerance=0.01)))
