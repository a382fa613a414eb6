"""Import of any table of samples by a mapping of its columns, `[data]` of a machine's file."""
