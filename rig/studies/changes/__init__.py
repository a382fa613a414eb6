"""How often `rig diff` names a planted change, and what changed on measured machines."""
