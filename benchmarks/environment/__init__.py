"""How fast the environment and its plant are, beside their peers, the paper's method and the machine: `make bench`."""
