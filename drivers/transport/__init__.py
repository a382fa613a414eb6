"""Byte transports opened by URL."""
