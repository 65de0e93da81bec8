"""What to do next: the experiment that tells apart what still stands."""
