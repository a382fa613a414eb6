"""Finding recordings again: an index of all campaigns under a folder, and a search in it."""
