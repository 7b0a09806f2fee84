"""Load alleviation with trailing-edge flaps on the NREL 5 MW wind turbine.

From the turbine's structure and vortex-lattice aerodynamics to a Gymnasium environment, controllers and the
comparison of their loads, after Ng, Hesse, Palacios, Graham and Kerrigan, "Model-based Aeroservoelastic Design
and Load Alleviation of Large Wind Turbines".
"""

from flapgym.envs import register_environments

__version__ = "0.1.0"

register_environments()
