"""The shipped model against the turbine marched with all its 12,570 circulations and its joint by azimuth."""

import numpy as np
import pytest

from flapgym.aeroelastic import load_model
from flapgym.aeroelastic.build import assemble_parts
from flapgym.aeroelastic.full import march_turbine
from flapgym.aeroelastic.multiblade import to_blades, to_components
from flapgym.turbine import load_case

CASE = load_case("nrel5mw-rated")
DT = CASE.discretisation.time_step
STEPS = 600


@pytest.fixture(scope="module")
def runs():
    """Marched and modelled outputs under a gust and unequal flaps, over four fifths of a revolution."""
    parts, rotor = assemble_parts(CASE)
    time = DT * np.arange(STEPS)
    azimuth = 0.3 + CASE.rotor_speed * time
    share = np.array([0.1, 0.0, -0.03])
    flap, rate = np.outer(np.sin(2.0 * time), share), np.outer(2.0 * np.cos(2.0 * time), share)
    wind = np.sin(0.9 * time)[:, None]
    marched = march_turbine(parts, rotor, np.hstack([flap, rate, wind]), 0.3)
    modelled = load_model("nrel5mw-rated").turbine.simulate(
        np.hstack([to_components(flap, azimuth), to_components(rate, azimuth), wind])
    )
    blades = [to_blades(modelled[:, first : first + 3], azimuth) for first in (0, 3)]
    return marched, np.hstack([*blades, modelled[:, 6:]])


@pytest.mark.parametrize(
    ("name", "columns"), [("root moment", slice(0, 3)), ("tip", slice(3, 6)), ("tower top", slice(6, 8))]
)
def test_reduced_time_invariant_model_is_within_a_thousandth_of_the_full_march(runs, name, columns):
    marched, modelled = (run[:, columns] for run in runs)
    error = np.sqrt(((modelled - marched) ** 2).mean(axis=0) / (marched**2).mean(axis=0))
    assert error.max() < 1e-3, name
