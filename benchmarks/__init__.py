"""Programs that measure the package's speed, beside others' in the same run."""
