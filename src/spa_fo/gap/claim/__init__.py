"""What is claimed of trials that took no part, and the answer held against it."""
