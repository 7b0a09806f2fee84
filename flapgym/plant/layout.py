"""Where the numbers of a plant lie in its flat arrays, by name: few arrays make a cheap call.

A step of one turbine costs about a microsecond, and every array handed to compiled code a twentieth of that. So what
a plant knows is packed into two arrays, one of doubles and one of the precision of its modes.
"""

from __future__ import annotations

from flapgym.core.arrays import BLADES

# ------------------------------------------------------------------- what a plant gives
# A row of what a turbine did during an action: the columns that every plant fills, in SI units.
RBM, TIP, ANGLE, RATE = 0, 3, 6, 9
"""Of blades 1 to 3 at the last sample: moment, tip deflection, flap angle and rate."""
TRAVEL, MEAN_SQUARE, STOPPED = 12, 15, 18
"""Way of each flap since the reset, mean square of each moment, whether the flap met a stop (0 or 1)."""
TOWER, WIND, AZIMUTH = 21, 23, 24
"""Tower top downwind and sideways, wind perturbation, azimuth of blade 1, all at the last sample."""
REWARD, REWARD_RBM, REWARD_ANGLE, REWARD_TOWER = 25, 26, 27, 28
"""The reward and its terms."""
COSINE, SINE = 29, 30
"""Of the azimuth."""
ROW = 31
"""Columns of a row."""

# A plant sample, where every one is wanted.
SAMPLE_RBM, SAMPLE_TIP, SAMPLE_TOWER, SAMPLE_WIND, SAMPLE_ANGLE, SAMPLE_RATE = 0, 3, 6, 8, 9, 12
SAMPLE = 15
"""Columns of a sample."""

TOUCH = 1e-12
"""Of the angle stop: a flap that is nearer to it, and goes on toward it, is at it. Commands at their bounds bring flaps
back to the very stop, and round-off must not decide whether they meet it."""

OUTPUTS = 9
"""Of turbine and wind: moments and tip deflections in components, tower, wind."""
FLAP_INPUTS = 6
"""Of the rotor; flap angle and rate in components."""

# ------------------------------------------------------------------- the doubles
# Head: sizes and switches, then physics.
COUNT, STEPS, INTERVALS, MODES, BLADE_COUNT, EVERY, OBSERVED, NOISY = range(8)
TIME_STEP, TURN, COSINE_TURN, SINE_TURN = range(8, 12)
ANGLE_LIMIT, RATE_LIMIT, ACCELERATION_LIMIT, LAG_DECAY, LAG_GAIN = range(12, 17)
WEIGHT_RBM, WEIGHT_ANGLE, WEIGHT_TOWER, LAYOUT = range(17, 21)
DISPLACED, EFFECTIVENESS, STUCK, WORK = 21, 22, 25, 28
"""Whether displacements are wanted; three a blade, three a blade; room for commands and for an interval's azimuth."""
HEAD = WORK + 5
"""Length of the head; behind it the table of the observation, a record a turbine, and noise."""
ENTRY = 4
"""Numbers an observed entry has in its table: column of the row, factor, bound, column of the noise or -1."""

# A turbine's record.
OWN_ANGLE, OWN_RATE, OWN_LAGGED, OWN_TRAVEL = 0, 3, 6, 9
"""Flap angle, rate, acceleration behind the lag, way since the reset: three each."""
OWN_AZIMUTH, OWN_ELAPSED, OWN_LEVEL, OWN_RESPONSE = 12, 13, 14, 15
"""Azimuth at the reset, intervals since, factor on the wind's response, its place in the pool."""
OWN = 16
"""Length of a record."""

# ------------------------------------------------------------------- the numbers of the modes
LANES = 16
"""Numbers that a vector of the compiled code has: modes of a group for one turbine, turbines of a block in a batch."""
FEWEST_IN_BATCH = 8
"""Turbines from which they are stepped side by side; fewer are stepped one by one, modes side by side."""
ALIGNMENT = 64
"""Bytes at whose multiples the numbers of the modes begin: vectors across two cache lines cost double."""
FREE = 9
"""Numbers that decide the flaps' motion over an interval under held accelerations: angle, rate and acceleration in
components in the frame of its start. Behind them come the deviations from that."""
STEP_INPUTS = 2 * BLADES
"""What a step may add to a motion that goes on: acceleration over it, and a jump of the angle at its end."""
VALUE, DRIVE, READ = 0, 2, 2
"""Rows of constants of the modes: eigenvalue, then either inputs to the real and to the imaginary part, or real and
imaginary part in turn to each moment."""
STEP_ROWS, PUSH_ROWS, READ_ROWS = DRIVE + 2 * STEP_INPUTS, DRIVE + 2 * BLADES, READ + 2 * BLADES
"""For what a step may add; for held accelerations; for the moments."""
OTHERS = 6
"""Outputs beside the moments: tip deflection, tower, wind."""
