"""A further output: the moment on the tower's foundation, asked for in a case, built, and then observed."""

import tempfile
from pathlib import Path

import gymnasium

import flapgym  # registers the environments
from flapgym.aeroelastic.build import build_model
from flapgym.turbine import load_case

CASE = """
base = "nrel5mw-rated"
name = "tower-base"
[signals]
outputs = ["tower_base_fore_aft"]
[discretisation]                  # a coarse lattice, built in seconds: leave both tables out for real loads
chordwise_panels = 2
wake_length = "0.05 rotor diameters"
time_step = "20 ms"
[reduction]
blade_modes = 4
tower_modes = 4
aerodynamic_states = 8
"""

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "tower-base.toml")
    path.write_text(CASE, encoding="utf-8")
    model = build_model(load_case(path))

env = gymnasium.make("flapgym/NREL5MW-v1", model=model, task={"observe": ["rbm", "tower_base_fore_aft"]})
observation, info = env.reset(seed=1)
print(f"flapgym {flapgym.__version__}: moment on the foundation {observation[3] / 1e6:.1f} MN m")
