"""What is said of an examined campaign."""
