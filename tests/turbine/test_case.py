"""The data classes hold what they were checked for, whoever makes them."""

import dataclasses
import json
import math
import pickle
import re

import numpy as np
import pytest

from flapgym.turbine import Case, load_case

RATED = load_case("nrel5mw-rated")


def altered(section, **changes):
    return dataclasses.replace(RATED, **{section: dataclasses.replace(getattr(RATED, section), **changes)})


def flapped(**changes):
    return dataclasses.replace(RATED, flaps=(dataclasses.replace(RATED.flaps[0], **changes),))


def test_angles_are_radians_inside():
    assert RATED.flaps[0].angle_limit == pytest.approx(math.radians(10.0), rel=1e-15)
    assert RATED.flaps[0].rate_limit == pytest.approx(math.radians(100.0), rel=1e-15)
    assert RATED.turbine.rotor.precone == pytest.approx(math.radians(2.5), rel=1e-15)


@pytest.mark.parametrize("value", [0.0, -0.1, 0.6, math.nan, math.inf, "10 deg", None, True])
def test_a_limit_out_of_range_is_refused_in_code_as_in_a_file(value):
    with pytest.raises(ValueError, match=r"^flap\.angle_limit: expected "):
        flapped(angle_limit=value)


@pytest.mark.parametrize("wind_speed", [0.0, 4.99, 61.0, math.nan])
def test_wind_beyond_what_the_model_holds_for_is_refused_with_the_range(wind_speed):
    with pytest.raises(
        ValueError, match=r"^operating_point\.wind_speed: expected a speed from 5 to 60 m/s, got"
    ):
        altered("operating_point", wind_speed=wind_speed)


def test_wind_above_rated_is_refused_without_pitch_and_names_what_to_give():
    with pytest.raises(
        ValueError,
        match=r"^operating_point\.pitch: .* above rated wind \(11\.4 m/s\), got 0 deg at .* 11\.5 m/s; give pitch",
    ):
        altered("operating_point", wind_speed=11.5)


@pytest.mark.parametrize("point", [(5.0, 0.0), (11.4, 0.0), (15.0, math.radians(10.45))])
def test_wind_up_to_rated_needs_no_pitch_and_above_it_may_be_any(point):
    wind_speed, pitch = point
    assert altered("operating_point", wind_speed=wind_speed, pitch=pitch).operating_point.pitch == pitch


def test_effectiveness_takes_a_number_or_a_word():
    assert flapped(effectiveness=0.5).flaps[0].effectiveness == 0.5
    with pytest.raises(ValueError, match=r"flap\.effectiveness"):
        flapped(effectiveness="half")


def test_a_negative_mass_density_is_refused_with_its_station():
    sections = RATED.turbine.blade_sections_12
    density = sections.mass_density.copy()
    density[4] = -1.0
    with pytest.raises(ValueError, match=r"blade_sections\.mass_density: .* got -1 kg/m at station 5"):
        dataclasses.replace(sections, mass_density=density)


def test_columns_of_different_length_are_refused():
    with pytest.raises(ValueError, match="expected as many stations in each column"):
        dataclasses.replace(RATED.turbine.tower, inertia=np.ones(5))


@pytest.mark.parametrize("end", [0, -1])
def test_a_blade_that_ends_short_of_hub_or_tip_is_refused(end):
    sections = RATED.turbine.blade_sections_documented
    radius = sections.radius.copy()
    radius[end] += 0.1 if end == 0 else -0.1
    with pytest.raises(
        ValueError, match=r"radius: expected stations from rotor\.hub_radius to rotor\.radius"
    ):
        dataclasses.replace(
            RATED.turbine, blade_sections_documented=dataclasses.replace(sections, radius=radius)
        )


def test_arrays_cannot_be_written_to():
    for sections in (RATED.turbine.blade_sections(48), RATED.turbine.tower, RATED.turbine.planform):
        with pytest.raises(ValueError, match="read-only"):
            next(v for v in vars(sections).values() if isinstance(v, np.ndarray))[0] = 0.0


def test_fields_cannot_be_set():
    with pytest.raises(dataclasses.FrozenInstanceError):
        RATED.flaps[0].angle_limit = 0.1


def test_hash_is_the_same_for_equal_cases_and_survives_pickling():
    assert len(RATED.hash()) == 64
    assert load_case("nrel5mw-rated").hash() == RATED.hash()
    assert pickle.loads(pickle.dumps(RATED)).hash() == RATED.hash()


def test_hash_ignores_the_names_of_case_and_turbine():
    turbine = dataclasses.replace(RATED.turbine, name="other")
    assert dataclasses.replace(RATED, name="other", turbine=turbine).hash() == RATED.hash()


def test_to_dict_is_plain_json_with_every_number_of_the_tables():
    plain = RATED.to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert {len(column) for column in plain["turbine"]["blade_sections_documented"].values()} == {49}
    assert {len(column) for column in plain["turbine"]["tower"].values()} == {11}
    assert plain["flap"]["angle_limit"] == RATED.flaps[0].angle_limit


@pytest.mark.parametrize("name", ["nrel5mw-rated", "nrel5mw-heavy-blade"])
def test_a_case_comes_back_from_what_it_was_written_as(name):
    case = load_case(name)
    again = Case.from_dict(json.loads(json.dumps(case.to_dict())))
    assert again.to_dict() == case.to_dict()
    assert again.hash() == case.hash()
    assert again.rotor_speed == case.rotor_speed


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda plain: plain["flap"].pop("angle_limit"), "flap.angle_limit: missing"),
        (lambda plain: plain["flap"].update(colour=1.0), "flap.colour: unknown key"),
        (lambda plain: plain["flap"].update(angle_limit=7.0), "flap.angle_limit: expected"),
        (lambda plain: plain["turbine"]["airfoils"][0].pop("name"), "turbine.airfoils[0].name: missing"),
    ],
)
def test_what_a_case_was_not_written_as_is_refused(change, said):
    plain = RATED.to_dict()
    change(plain)
    with pytest.raises(ValueError, match=re.escape(said)):
        Case.from_dict(plain)


def nudged(value, path):
    """A copy of a data class with the number at `path` (field names and an index) changed in its last digits."""
    key, *rest = path
    if isinstance(value, np.ndarray):
        changed = value.copy()
        changed[key] = np.nextafter(changed[key], np.inf)
        return changed
    if isinstance(value, tuple):
        return tuple(nudged(item, rest) if i == key else item for i, item in enumerate(value))
    inner = getattr(value, key)
    if not rest:
        return dataclasses.replace(
            value, **{key: inner + 1 if isinstance(inner, int) else np.nextafter(inner, 1e99)}
        )
    return dataclasses.replace(value, **{key: nudged(inner, rest)})


@pytest.mark.parametrize(
    "path",
    [
        ("operating_point", "air_density"),
        ("flaps", 0, "rate_limit"),
        ("reduction", "blade_modes"),
        ("turbulence", "length_scale"),
        ("turbine", "gravity"),
        ("turbine", "rated_wind_speed"),
        ("turbine", "nacelle", "roll_inertia"),
        ("turbine", "hub", "mass"),
        ("turbine", "tower", "inertia", 10),
        ("turbine", "blade_sections_12", "twist", 3),
        ("turbine", "planform", "chord", 18),
        ("turbine", "airfoils", 4, "lift_slope"),
    ],
)
def test_hash_changes_with_the_last_digit_of_a_number(path):
    assert nudged(RATED, path).hash() != RATED.hash()


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        ("discretisation", {"tower_elements": 40}, "discretisation.tower_elements: expected 10"),
        ("discretisation", {"blade_elements": 48}, "discretisation.first_lattice_node: expected at least"),
        ("discretisation", {"first_lattice_node": 0}, "where the sections have lift, got 0"),
        ("reduction", {"blade_modes": 73}, "reduction.blade_modes: expected at most 72"),
        ("reduction", {"tower_modes": 67}, "reduction.tower_modes: expected at most 66"),
    ],
)
def test_setting_that_does_not_fit_the_turbine_is_refused_at_the_door(section, change, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        dataclasses.replace(RATED, **{section: dataclasses.replace(getattr(RATED, section), **change)})


@pytest.mark.parametrize(
    "value", [(1.0, 1.0), (1.0, 1.0, 0.1), (1.0, 1.0, math.nan), 1.0, (1.0, 1.0, "1 kg"), (1.0, 1.0, True)]
)
def test_a_factor_that_is_not_three_numbers_in_range_is_refused(value):
    with pytest.raises(ValueError, match=r"^blades\.mass_factor(\[2\])?: expected "):
        altered("blades", mass_factor=value)


def test_one_blade_s_factors_go_into_turbine_and_pitch_of_the_case_of_three_like_it():
    case = altered("blades", mass_factor=(1.0, 1.0, 1.1), pitch_offset=(0.0, 0.0, 0.01))
    assert case.blades.unequal == ("mass_factor", "pitch_offset")
    heavy, light = case.of_blade(2), case.of_blade(0)
    assert heavy.operating_point.pitch == RATED.operating_point.pitch + 0.01
    np.testing.assert_allclose(
        heavy.turbine.blade_sections_12.mass_density, 1.1 * RATED.turbine.blade_sections_12.mass_density
    )
    assert light.hash() == RATED.hash() != heavy.hash()
    assert not heavy.blades.unequal
    with pytest.raises(ValueError, match=r"^blades\.mass_factor: expected equal blades here"):
        case.alike()


def test_a_lattice_on_sections_whose_listed_slope_is_zero_is_refused():
    case = load_case("nrel5mw-corrected")
    foils = tuple(dataclasses.replace(foil, normal_force_slope=0.0) for foil in case.turbine.airfoils)
    with pytest.raises(ValueError, match="airfoils.normal_force_slope: expected sections with lift"):
        dataclasses.replace(case, turbine=dataclasses.replace(case.turbine, airfoils=foils))
