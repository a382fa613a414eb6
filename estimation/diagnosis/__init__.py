"""The result of a diagnosis, the split of its runs, and the audit of recordings."""
