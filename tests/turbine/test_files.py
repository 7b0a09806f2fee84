"""Files of people: what is not understood is refused with the field's name, before any work."""

import dataclasses
import os
from importlib import resources
from itertools import pairwise

import pytest

from flapgym.turbine import Case, load_case, load_turbine

DATA = resources.files("flapgym.turbine").joinpath("data")
TURBINE_TEXT = DATA.joinpath("nrel5mw.toml").read_text(encoding="utf-8")
CASE_TEXT = DATA.joinpath("nrel5mw-rated.toml").read_text(encoding="utf-8")


def write(folder, text, name="mine.toml"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def replaced(text, old, new):
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)


FIRST_TOWER_ROW = next(row for row in TURBINE_TEXT.splitlines(keepends=True) if " 0.00, 5590.87" in row)

TURBINE_FAULTS = {
    "unknown key": (
        'precone = "2.5 deg"',
        'precnoe = "2.5 deg"',
        "rotor.precnoe: unknown key; did you mean 'precone'?",
    ),
    "unknown table": ("[hub]", "[spinner]", "spinner: unknown key"),
    "missing key": ('mass = "56780 kg"', "", "hub.mass: missing"),
    "negative mass": ('mass = "56780 kg"', 'mass = "-5 kg"', "hub.mass: expected 0 kg <= mass, got -5 kg"),
    "wrong dimension": ('radius = "63.0 m"', 'radius = "63.0 kg"', "rotor.radius: expected a length in 'm'"),
    "no unit": ('radius = "63.0 m"', "radius = 63.0", "rotor.radius: expected a length"),
    "not a number": ('mass = "56780 kg"', 'mass = "nan kg"', "hub.mass: expected a mass"),
    "too large a number": ('mass = "56780 kg"', 'mass = "1e999 kg"', "hub.mass: expected a finite mass"),
    "hub beyond tip": (
        'hub_radius = "1.5 m"',
        'hub_radius = "70 m"',
        "rotor.hub_radius: expected less than rotor.radius",
    ),
    "missing station": (
        FIRST_TOWER_ROW,
        "",
        "tower.rows: expected the 11 stations declared by tower.stations, got 10",
    ),
    "a word for a number": (
        'gravity = "9.80665 m/s^2"',
        'gravity = "strong"',
        "gravity: expected an acceleration",
    ),
    "a yes for a count": (
        "blade_count = 3 ",
        "blade_count = true ",
        "rotor.blade_count: expected a whole number",
    ),
    "unknown aerofoil": (
        'name = "DU40_A17"',
        'name = "DU41_A17"',
        "planform.airfoil: expected one entry of airfoils",
    ),
    "column twice": ('"inertia [kg m]"', '"height [m]"', "tower.columns: expected each column once"),
    "column unknown": (
        '"inertia [kg m]"',
        '"inertai [kg m]"',
        "tower.inertai: unknown key; did you mean 'inertia'?",
    ),
    "column's unit": (
        '"inertia [kg m]"',
        '"inertia [kg]"',
        "tower.inertia: expected an inertia per length in 'kg m'",
    ),
    "tower above the ground": (
        "0.00, 5590.87",
        "1.00, 5590.87",
        "tower.height: expected 0 m at the first station",
    ),
    "radius not increasing": (
        "87.60, 2536.27",
        "70.00, 2536.27",
        "tower.height: expected values that increase",
    ),
    "negative mass at a station": (
        "0.00, 5590.87",
        "0.00, -5590.87",
        "tower.mass_density: expected 0 kg/m <= mass per length, got -5590.87 kg/m at station 1",
    ),
    "no number at a station": (
        "0.00, 5590.87",
        "0.00, nan",
        "tower.mass_density: expected 0 kg/m <= mass per length",
    ),
    "text at a station": (
        "0.00, 5590.87",
        '0.00, "many"',
        "tower.mass_density: expected a number, got 'many'",
    ),
    "short row": ("0.00, 5590.87", "5590.87", "tower.rows: expected 6 values at station 1"),
    "broken file": ("[rotor]", "[rotor", "not valid TOML"),
}


@pytest.mark.parametrize("fault", TURBINE_FAULTS)
def test_a_fault_in_a_turbine_file_is_named(tmp_path, fault):
    old, new, message = TURBINE_FAULTS[fault]
    path = write(tmp_path, replaced(TURBINE_TEXT, old, new))
    with pytest.raises(ValueError) as caught:
        load_turbine(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value).strip()


CASE_FAULTS = {
    "typo": (
        "wind_speed =",
        "wind_sped =",
        "operating_point.wind_sped: unknown key; did you mean 'wind_speed'?",
    ),
    "wrong unit": (
        '"10 deg"',
        '"10 m"',
        "flap.angle_limit: expected an angle in 'deg' or 'rad', got the unit 'm'",
    ),
    "zero limit": ('"10 deg"', '"0 deg"', "flap.angle_limit: expected 0 deg < angle <= 30 deg, got 0 deg"),
    "effectiveness": (
        '"glauert"',
        '"glaurt"',
        "flap.effectiveness: expected a number such as 0.5, got 'glaurt'; or write 'glauert'",
    ),
    "inside out flap": (
        "span_end = 0.9",
        "span_end = 0.6",
        "flap.span_end: expected more than flap.span_start (0.7)",
    ),
    "elements": ("blade_elements = 12", "blade_elements = 20", "blade_elements: expected 12 or 48, got 20"),
    "part of an element": (
        "tower_elements = 10",
        "tower_elements = 9.5",
        "tower_elements: expected a whole number",
    ),
    "lattice beyond the tip": (
        "first_lattice_node = 2",
        "first_lattice_node = 12",
        "discretisation.first_lattice_node: expected less than discretisation.blade_elements (12), got 12",
    ),
    "no wind": (
        '"11 m/s"',
        '"0 m/s"',
        "operating_point.wind_speed: expected a speed from 5 to 60 m/s, got 0 m/s",
    ),
    "induction": (
        "induction = 0.0",
        "induction = 0.5",
        "discretisation.induction: expected 0 <= number < 0.5",
    ),
    "empty name": ('name = "nrel5mw-rated"', 'name = ""', "name: expected a text, got ''"),
    "turbine a number": ('turbine = "nrel5mw"', "turbine = 5", "turbine: expected a text, got 5"),
}


@pytest.mark.parametrize("fault", CASE_FAULTS)
def test_a_fault_in_a_case_file_is_named(tmp_path, fault):
    old, new, message = CASE_FAULTS[fault]
    path = write(tmp_path, replaced(CASE_TEXT, old, new))
    with pytest.raises(ValueError) as caught:
        load_case(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("load, built_in", [(load_case, "nrel5mw-rated"), (load_turbine, "nrel5mw")])
@pytest.mark.parametrize("wrong", ["nrel5mw-rates", "missing.toml", ""])
def test_a_name_that_is_no_file_lists_the_built_in_ones(load, built_in, wrong):
    with pytest.raises(FileNotFoundError) as caught:
        load(wrong)
    assert repr(wrong) in str(caught.value)
    assert built_in in str(caught.value)


def test_a_file_that_is_not_text_is_refused(tmp_path):
    path = tmp_path / "model.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="expected text in UTF-8, got UTF-16"):
        load_case(path)


def test_a_copy_of_the_shipped_case_is_the_shipped_case(tmp_path):
    assert load_case(write(tmp_path, CASE_TEXT)).hash() == load_case("nrel5mw-rated").hash()


def test_a_derived_case_holds_only_what_differs(tmp_path):
    text = 'base = "nrel5mw-rated"\nname = "gusty"\n[turbulence]\nintensity = "20 %"\n'
    case, rated = load_case(write(tmp_path, text)), load_case("nrel5mw-rated")
    assert case.name == "gusty"
    assert case.turbulence.intensity == pytest.approx(0.2)
    assert case.turbulence.length_scale == rated.turbulence.length_scale
    assert case.flaps[0] == rated.flaps[0]
    assert case.hash() != rated.hash()


def test_a_derived_case_needs_a_name_of_its_own(tmp_path):
    with pytest.raises(ValueError, match="name: missing"):
        load_case(write(tmp_path, 'base = "nrel5mw-rated"\n'))


def test_a_case_without_turbine_is_asked_for_its_base(tmp_path):
    with pytest.raises(ValueError, match='base: missing; give .* base = "nrel5mw-rated"'):
        load_case(write(tmp_path, 'name = "mine"\n[flap]\nrate_limit = "20 deg/s"\n'))


def test_a_typo_in_a_derived_case_is_named(tmp_path):
    text = 'base = "nrel5mw-rated"\nname = "mine"\n[flap]\nangle_limt = "5 deg"\n'
    with pytest.raises(ValueError, match="flap.angle_limt: unknown key; did you mean 'angle_limit'"):
        load_case(write(tmp_path, text))


def test_a_number_in_place_of_a_table_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"flap: expected one or more tables \[\[flap\]\], got 3"):
        load_case(write(tmp_path, 'base = "nrel5mw-rated"\nname = "mine"\nflap = 3\n'))


def test_a_number_in_place_of_a_single_table_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"reduction: expected a table \[reduction\], got 3"):
        load_case(write(tmp_path, 'base = "nrel5mw-rated"\nname = "mine"\nreduction = 3\n'))


FLAP = """
[[flap]]
span_start = {}
span_end = {}
chord_fraction = "10 %"
effectiveness = "glauert"
angle_limit = "10 deg"
rate_limit = "100 deg/s"
acceleration_limit = "600 deg/s^2"
"""


def test_several_flaps_replace_the_one_of_the_base_and_one_in_a_list_is_the_same_flap(tmp_path):
    head = 'base = "nrel5mw-rated"\nname = "mine"\n'
    edges = (0.45, 0.6, 0.75, 0.9)
    several = load_case(write(tmp_path, head + "".join(map(FLAP.format, edges, edges[1:]))))
    assert [(flap.span_start, flap.span_end) for flap in several.flaps] == list(pairwise(edges))
    assert Case.from_dict(several.to_dict()).hash() == several.hash() != load_case("nrel5mw-rated").hash()
    one = load_case(write(tmp_path, head + FLAP.format(0.7, 0.9)))
    assert one.hash() == load_case("nrel5mw-rated").hash()


@pytest.mark.parametrize(
    "ends, said",
    [
        (
            ((0.5, 0.7), (0.6, 0.8)),
            r"flap\[1\].span_start: expected at least flap\[0\].span_end \(0.7\), got 0.6; list the flaps from root",
        ),
        (
            ((0.7, 0.9), (0.5, 0.7)),
            r"flap\[1\].span_start: expected at least flap\[0\].span_end \(0.9\), got 0.5",
        ),
        (((0.5, 0.7), (0.7, 1.2)), r"flap\[1\].span_end: expected 0 < number <= 1"),
    ],
)
def test_flaps_that_overlap_or_stand_out_of_order_are_refused(tmp_path, ends, said):
    text = 'base = "nrel5mw-rated"\nname = "mine"\n' + "".join(FLAP.format(*each) for each in ends)
    with pytest.raises(ValueError, match=said):
        load_case(write(tmp_path, text))


def test_base_and_turbine_are_found_beside_the_file_that_names_them(tmp_path):
    (tmp_path / "machines").mkdir()
    soft = replaced(TURBINE_TEXT, 'name = "nrel5mw"', 'name = "heavy-hub"').replace('"56780 kg"', '"60 t"')
    write(tmp_path / "machines", soft, "heavy.toml")
    write(tmp_path, 'base = "nrel5mw-rated"\nname = "first"\nturbine = "machines/heavy.toml"\n', "first.toml")
    second = write(tmp_path / "machines", 'base = "../first.toml"\nname = "second"\n', "second.toml")
    assert load_case(second).turbine.hub.mass == 60000.0


def test_a_fault_in_the_turbine_of_a_case_names_the_turbine_s_file(tmp_path):
    write(tmp_path, replaced(TURBINE_TEXT, '"56780 kg"', '"56780 kN"'), "faulty.toml")
    path = write(tmp_path, 'base = "nrel5mw-rated"\nname = "mine"\nturbine = "faulty.toml"\n')
    with pytest.raises(ValueError, match=r"hub.mass: .*faulty.toml\) \(in .*mine.toml\)$"):
        load_case(path)


def test_cases_that_derive_from_each_other_are_refused(tmp_path):
    write(tmp_path, 'base = "b.toml"\nname = "a"\n', "a.toml")
    write(tmp_path, 'base = "a.toml"\nname = "b"\n', "b.toml")
    with pytest.raises(ValueError, match="base: expected a file that does not lead back here"):
        load_case(tmp_path / "a.toml")


def test_a_missing_base_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="case 'nothing': no such file"):
        load_case(write(tmp_path, 'base = "nothing"\nname = "a"\n'))


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('"10 deg"', "1" + 399 * "0", "flap.angle_limit: expected a number of at most 64 bits"),
        (
            "first_lattice_node = 2",
            "first_lattice_node = 1" + 399 * "0",
            "expected a number of at most 64 bits",
        ),
        ("first_lattice_node = 2", "first_lattice_node = 2.0", "first_lattice_node: expected a whole number"),
        (
            "first_lattice_node = 2",
            "first_lattice_node = true",
            "first_lattice_node: expected a whole number",
        ),
        ('"10 deg"', "true", "flap.angle_limit: expected an angle"),
        ('"10 deg"', "nan", "flap.angle_limit: expected an angle"),
        ('"10 deg"', '"1' + 50_000 * " " + '\\n"', "flap.angle_limit: expected an angle"),
        ('"10 deg"', "[[[]]]", "flap.angle_limit: expected an angle"),
        ("first_lattice_node = 2", "first_lattice_node = [2]", "first_lattice_node: expected a whole number"),
        ('name = "nrel5mw-rated"', 'name = "a\\nb"', "name: expected a text of one line"),
        ('name = "nrel5mw-rated"', 'name = "\\u001b[31m"', "name: expected a text of one line"),
        ('name = "nrel5mw-rated"', "name = 1", "name: expected a text, got 1"),
        ("[flap]", '["\\u001b[31m"]', "\\x1b[31m: unknown key"),
    ],
)
def test_a_value_of_another_kind_costs_one_line_that_names_the_field(tmp_path, old, new, message):
    path = write(tmp_path, replaced(CASE_TEXT, old, new))
    with pytest.raises(ValueError) as caught:
        load_case(path)
    assert message in str(caught.value)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 600


@pytest.mark.parametrize(
    "text", ["base = []", "base = 1", "base = {}", "turbine = 1", "[turbine]", "[[turbine]]"]
)
def test_a_base_or_turbine_that_is_no_text_is_refused_by_its_field(tmp_path, text):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=r"^(base|turbine): expected a text, got .* \(in .*mine\.toml\)$"):
        load_case(path)


@pytest.mark.parametrize("path, kind", [("/dev/zero", "a device"), ("pipe", "a pipe"), (".", "a folder")])
def test_a_case_is_a_regular_file_also_where_another_names_it(tmp_path, path, kind):
    if path == "pipe":
        path = tmp_path / "pipe"
        os.mkfifo(path)
    for name in (
        path,
        write(tmp_path, f'base = "{path}"\n'),
        write(tmp_path, f'turbine = "{path}"\n', "b.toml"),
    ):
        with pytest.raises(ValueError, match=f"expected a regular file, got {kind}"):
            load_case(name)


def test_a_number_beyond_double_precision_is_out_of_range():
    case = load_case("nrel5mw-rated")
    with pytest.raises(ValueError, match=r"operating_point.wind_speed: expected .* got inf"):
        dataclasses.replace(case.operating_point, wind_speed=10**400)
    with pytest.raises(
        ValueError, match=r"reduction.blade_modes: expected a whole number.* got an integer of some"
    ):
        dataclasses.replace(case.reduction, blade_modes=10**400)
