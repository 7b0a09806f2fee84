"""What the studies of the paper's Section IV and the benchmarks share: numbers as dataclasses, rendered last."""
