"""Pages on a campaign: its diagnosis, its adaptation."""
