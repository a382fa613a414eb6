"""Pure functions on arrays: recordings, filters, effects, models. Imports no other room."""
