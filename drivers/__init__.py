"""Devices and the transports they speak over. Imports no other room."""
