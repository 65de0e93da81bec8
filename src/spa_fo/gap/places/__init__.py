"""Free-form laws: where the missing effect sits, and what it looks like."""
