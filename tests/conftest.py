"""A model file of the synthetic turbine: small, quick, and found by name like any other."""

from __future__ import annotations

import pytest

from flapgym.model.turbine_model import save_model
from tests.synthetic import synthetic_model


@pytest.fixture(autouse=True)
def _without_a_screen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture(scope="session")
def model_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "synthetic.safetensors"
    save_model(synthetic_model(), path)
    return str(path)
