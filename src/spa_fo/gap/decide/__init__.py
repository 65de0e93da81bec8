"""From fitted explanations to probabilities, and from these to an answer, or to none."""
