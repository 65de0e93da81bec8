"""Which explanations are worth a fit, and what each is worth."""
