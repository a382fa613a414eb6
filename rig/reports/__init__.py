"""Reports: tables for a terminal, for Markdown and for a page of HTML that needs nothing else."""
