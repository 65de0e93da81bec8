"""Models of the actuator: the fractional transfer function and the baselines."""
