"""One explanation as a least-squares problem, and its solution."""
