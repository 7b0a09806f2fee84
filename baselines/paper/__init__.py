"""The paper's Section IV in one report: `python -m baselines.paper`, or `make paper`."""
