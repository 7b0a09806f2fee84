"""What only checks the product: slower, plainer or more complete ways to the same numbers. Not installed.

The paper's equation 14 with Lagrange multipliers, the full lattice's march, non-linear beams and turbines, and the
plainest stepping of the plant.
"""
