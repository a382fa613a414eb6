"""The connected rig: its logger and further devices, opened, and the session that uses them."""
