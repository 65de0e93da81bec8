"""What changed between two campaigns of one actuator."""
