"""All campaigns under a folder: an index, a search in it, and work on each of them."""
