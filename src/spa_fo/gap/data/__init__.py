"""What a campaign offers as evidence, and which of its trials take no part."""
