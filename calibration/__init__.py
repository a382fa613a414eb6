"""Counts to SI units, and the records that say how. Imports estimation only."""
