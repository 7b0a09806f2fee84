"""The printed summary says what the functions compute."""

import numpy as np
import pytest

from flapgym.aerodynamics import mean_loads, rigid_rotor, root_moment_load
from flapgym.aerodynamics.report import describe_aerodynamics
from flapgym.cli import main


@pytest.fixture(scope="module")
def text(case):
    return describe_aerodynamics(case)


def test_summary_holds_mean_loads_and_gains(text, case, rotor):
    mean, gains = mean_loads(case, rotor), rigid_rotor(case).steady(root_moment_load(rotor, case))[0]
    for figure in (
        f"{mean.thrust / 1e3:.1f} kN",
        f"{mean.torque / 1e3:.1f} kN m",
        f"coefficient {mean.power_coefficient:.3f}",
        f"{gains[0] / 1e6:.4f}",
        f"{np.radians(gains[1]) / 1e6:.4f}",
        "409 rows",
        "12570 circulations",
        "1.1232",
    ):
        assert figure in text


def test_summary_has_no_line_wider_than_a_page(text):
    assert max(len(line) for line in text.splitlines()) <= 110


def test_command_prints_it_and_refuses_an_unknown_case(text, capsys):
    assert main(["aero", "nrel5mw-rated"]) == 0
    assert capsys.readouterr().out.strip().endswith(text)  # after the turbine's name
    assert main(["aero", "nosuch"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
