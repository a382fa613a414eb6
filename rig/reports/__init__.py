"""Pages on a campaign: its first look, its diagnosis, its adaptation."""
