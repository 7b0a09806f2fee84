"""Ways to compute one and the same step: each file gives `step(parameters, episode, state, actions)`."""
