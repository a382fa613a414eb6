"""Devices and their transports. Imports no other top-level package."""
