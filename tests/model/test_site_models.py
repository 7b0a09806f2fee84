"""The shipped models for a site's wind: the corrected turbine with strips, weight, pitch and further outputs."""

import numpy as np
import pytest

from flapgym.model import flap_inputs, load_model, pitch_inputs, strip_inputs
from flapgym.model.turbine_model import builtin_models
from flapgym.turbine import load_case

SITE = ("nrel5mw-site", "nrel5mw-three-flaps")
OUTPUTS = ("rbm_edge_0", "rbm_edge_c", "rbm_edge_s", "tower_base_fore_aft", "tower_top_acceleration_fore_aft")


@pytest.fixture(scope="module", params=SITE)
def model(request):
    return load_model(request.param)


def test_site_models_are_shipped_and_are_built_of_their_cases(model):
    assert model.name in builtin_models()
    assert load_case(model.name).hash() == model.inputs_hash


def test_site_models_have_strips_pitch_and_gravity_as_inputs_and_the_further_outputs_last(model):
    further = (*strip_inputs(10), *pitch_inputs(), "gravity")
    assert model.turbine.inputs == (*flap_inputs(len(model.flaps)), "wind", *further)
    assert model.turbine.outputs[8:] == OUTPUTS
    assert model.pitch_actuator == load_case(model.name).pitch


def test_winds_on_all_strips_alike_are_the_homogeneous_wind(model):
    turbine = model.turbine
    first, count = turbine.inputs.index("wind1_0"), 3 * model.strips
    for matrix in (turbine.B, turbine.D):
        wind, strips = (
            matrix[:, turbine.inputs.index("wind")],
            matrix[:, first : first + count : 3].sum(axis=1),
        )
        np.testing.assert_allclose(strips, wind, atol=1e-11 * np.abs(wind).max())


def test_further_inputs_and_outputs_cost_pitch_s_slow_state_alone_and_leave_the_corrected_turbine_as_it_is():
    site, corrected = (load_model(name).turbine for name in ("nrel5mw-site", "nrel5mw-corrected"))
    assert site.order == corrected.order + 1
    shared = site.select(inputs=corrected.inputs, outputs=corrected.outputs)
    frequency = np.geomspace(1e-3, 20.0, 40)
    given, wanted = (turbine.frequency_response(frequency) for turbine in (shared, corrected))
    size = np.abs(wanted).max(axis=(0, 2), keepdims=True)
    np.testing.assert_allclose(given / size, wanted / size, atol=1e-10)


def test_three_flaps_have_a_slow_state_each_where_one_has_one():
    three, one = (load_model(name).turbine for name in ("nrel5mw-three-flaps", "nrel5mw-site"))
    assert three.order == one.order + 2


def test_weight_is_most_of_the_edgewise_moment(model):
    """wind.md's trial: 3.6 MN m once a revolution; published first mass moment times gravity 3.56."""
    gain = (
        model.turbine.dc_gain()[:, model.turbine.inputs.index("gravity")]
        * load_case(model.name).turbine.gravity
    )
    edge = [gain[model.turbine.outputs.index(f"rbm_edge_{part}")] for part in ("c", "s")]
    assert np.hypot(*edge) == pytest.approx(3.56e6, rel=0.06)
