"""Models and estimators of one instrument, made fit for another."""
