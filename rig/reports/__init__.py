"""Pages on a campaign: its screening, its diagnosis, its adaptation."""
