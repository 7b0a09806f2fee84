"""Programs that train policies with Stable-Baselines3 and write them as agents that run in numpy."""

from flapgym.core.program import leave_programs_at_interrupt

leave_programs_at_interrupt(__name__)
