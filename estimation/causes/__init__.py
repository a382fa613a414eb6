"""Physical causes of what declared equations leave unexplained: hypotheses and probabilities."""
