"""Programs that tune and report the paper's controllers (section IV.C)."""
