"""How results reach a person or a program: console, JSON, tables, figures, pages, provenance."""
