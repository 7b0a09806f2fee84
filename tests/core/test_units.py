"""Quantities written by people come out in SI, whatever the accepted unit, or not at all."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flapgym.core.units import UNITS, parse_quantity

NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e30, max_value=1e30)
PAIRS = st.sampled_from([(dimension, unit) for dimension, units in UNITS.items() for unit in units])


@pytest.mark.parametrize(
    "text, dimension, expected",
    [
        ("180 deg", "angle", math.pi),
        ("1 rad", "angle", 1.0),
        ("100 deg/s", "angular rate", 1.7453292519943295),
        ("7 ms", "time", 0.007),
        ("10 %", "number", 0.1),
        ("0.25", "number", 0.25),
        (0.25, "number", 0.25),
        (3, "number", 3.0),
        ("1 1/deg", "slope", 57.29577951308232),
        ("867.637e6 N m/rad", "torsion spring", 867637000.0),
        ("240 t", "mass", 240000.0),
        ("  63   m ", "length", 63.0),
        ("10deg", "angle", 0.17453292519943295),
        ("+1.e-2 m", "length", 0.01),
        ("-.5 m", "length", -0.5),
    ],
)
def test_a_quantity_is_read_into_si(text, dimension, expected):
    assert parse_quantity(text, dimension, "field") == pytest.approx(expected, rel=1e-15)


@given(NUMBERS, PAIRS)
def test_a_number_and_its_unit_come_out_as_their_product(number, pair):
    dimension, unit = pair
    assert parse_quantity(f"{number!r} {unit}", dimension, "field") == number * UNITS[dimension][unit]


@given(NUMBERS, PAIRS, st.sampled_from(sorted(UNITS)))
def test_a_unit_of_another_dimension_is_refused_by_the_field_s_name(number, pair, dimension):
    unit = pair[1]
    if unit not in UNITS[dimension]:
        with pytest.raises(ValueError, match=r"^flap\.angle_limit: "):
            parse_quantity(f"{number!r} {unit}", dimension, "flap.angle_limit")


@given(st.text(), st.sampled_from(sorted(UNITS)))
def test_any_text_is_either_a_finite_quantity_or_refused_by_name(text, dimension):
    try:
        value, message = parse_quantity(text, dimension, "field"), ""
    except ValueError as error:
        value, message = 0.0, str(error)
    assert math.isfinite(value)
    assert not message or message.startswith("field: expected ")


@given(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.lists(st.floats()), st.just({})),
    st.sampled_from(sorted(dimension for dimension in UNITS if "" not in UNITS[dimension])),
)
def test_only_a_text_can_carry_a_unit(value, dimension):
    with pytest.raises(ValueError, match="^field: expected "):
        parse_quantity(value, dimension, "field")


@pytest.mark.parametrize(
    "value", [True, math.nan, math.inf, "nan", "inf", "1e999", "1,5", "1.5 deg", "", "deg"]
)
def test_what_is_no_plain_number_is_refused(value):
    with pytest.raises(ValueError, match="^field: expected a"):
        parse_quantity(value, "number", "field")
