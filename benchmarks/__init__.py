"""Programs that measure the package's speed, beside others' in the same run."""

from flapgym.core.program import leave_programs_at_interrupt

leave_programs_at_interrupt(__name__)
