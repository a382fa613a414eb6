"""The command line: one module a verb, thin; imports of heavy packages stay inside the verbs."""
