import pytest

from flapgym.aerodynamics import build_aerodynamics
from flapgym.turbine import load_case


@pytest.fixture(scope="session")
def case():
    return load_case("nrel5mw-rated")


@pytest.fixture(scope="session")
def rotor(case):
    return build_aerodynamics(case)


@pytest.fixture(scope="session")
def single_blade(case):
    return build_aerodynamics(case, blades=1)
