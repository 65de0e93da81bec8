"""From trials to coefficients: swarm, polish, uncertainty, ablation."""
