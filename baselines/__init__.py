"""Programs that tune and report the paper's controllers (section IV.C)."""

from flapgym.core.program import leave_programs_at_interrupt

leave_programs_at_interrupt(__name__)
