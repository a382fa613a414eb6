"""ATI Net F/T: raw data transfer over UDP."""
