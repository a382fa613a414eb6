"""Conversion of counts to SI units, and its records. Imports estimation only."""
