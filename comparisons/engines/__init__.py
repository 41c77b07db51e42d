"""Engines: the protocol, the registry, and one adapter a file."""
