"""The shipped models against turbines marched with all their 12,570 circulations and their joint by azimuth."""

import numpy as np
import pytest

from flapgym.aeroelastic.build import assemble_parts, slow_wake
from flapgym.core.multiblade import to_blades, to_components
from flapgym.model import load_model
from flapgym.turbine import load_case
from reference.full import march_turbine

STEPS = 600


@pytest.fixture(scope="module", params=["nrel5mw-rated", "nrel5mw-corrected"])
def runs(request):
    """Marched and modelled outputs under a gust and unequal flaps, over four fifths of a revolution."""
    case = load_case(request.param)
    parts, rotor = assemble_parts(case)
    time = case.discretisation.time_step * np.arange(STEPS)
    azimuth = 0.3 + case.rotor_speed * time
    share = np.array([0.1, 0.0, -0.03])
    flap, rate = np.outer(np.sin(2.0 * time), share), np.outer(2.0 * np.cos(2.0 * time), share)
    wind = np.sin(0.9 * time)[:, None]
    inputs = np.hstack([to_components(flap, azimuth), to_components(rate, azimuth), wind])
    # The states of a moving wake stand before the lattice, marched or reduced.
    felt = slow_wake(parts).simulate(inputs)
    blades = [to_blades(felt[:, first : first + 3], azimuth) for first in (0, 3)]
    marched = march_turbine(parts, rotor, np.hstack([*blades, felt[:, 6:]]), 0.3)
    modelled = load_model(request.param).turbine.simulate(inputs)
    blades = [to_blades(modelled[:, first : first + 3], azimuth) for first in (0, 3)]
    return marched, np.hstack([*blades, modelled[:, 6:]])


@pytest.mark.parametrize(
    ("name", "columns"), [("root moment", slice(0, 3)), ("tip", slice(3, 6)), ("tower top", slice(6, 8))]
)
def test_reduced_time_invariant_model_is_within_a_thousandth_of_the_full_march(runs, name, columns):
    marched, modelled = (run[:, columns] for run in runs)
    error = np.sqrt(((modelled - marched) ** 2).mean(axis=0) / (marched**2).mean(axis=0))
    assert error.max() < 1e-3, name
