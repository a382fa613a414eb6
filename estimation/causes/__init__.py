"""Which physical cause explains what the declared equations do not: hypotheses and their probability."""
