"""Programs that train policies with Stable-Baselines3 and write them as agents that run in numpy."""
