"""AMT21 absolute encoder over RS-485."""
