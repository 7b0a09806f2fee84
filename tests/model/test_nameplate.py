"""What a case tells of the machine behind a model: the geometry for the wind over its disk."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flapgym.core.fields import to_plain
from flapgym.model.nameplate import disk_of, nameplate
from flapgym.turbine import load_turbine

TURBINE = load_turbine("nrel5mw")


def test_the_tower_s_radius_that_its_masses_tell_is_the_published_one():
    # NREL/TP-500-38060, section 6: diameters of 6 m at the base and 3.87 m at the top.
    disk = disk_of(TURBINE.rotor, TURBINE.tower)
    np.testing.assert_allclose(disk.tower_radius[[0, -1]], [3.0, 1.935], rtol=0.01)
    assert disk.hub_height == pytest.approx(90.0, abs=0.01)


def test_a_tower_without_mass_tells_no_radius():
    tower = replace(TURBINE.tower, inertia=np.zeros_like(TURBINE.tower.inertia))
    with pytest.raises(
        ValueError, match="^tower.inertia: expected more than 0 at every station, .* at station 1"
    ):
        disk_of(TURBINE.rotor, tower)


def test_a_case_tells_the_disk_or_nothing():
    machine = to_plain(TURBINE)
    found = nameplate({"turbine": machine}).disk
    assert found is not None
    np.testing.assert_array_equal(found.tower_radius, disk_of(TURBINE.rotor, TURBINE.tower).tower_radius)
    assert nameplate({"turbine": {"rotor": machine["rotor"]}}).disk is None
    assert nameplate({}).disk is None
