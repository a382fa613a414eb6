"""Physical causes of the residual of declared equations: hypotheses and their probabilities."""
