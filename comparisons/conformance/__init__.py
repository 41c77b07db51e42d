"""Conformance: checks of an engine adapter against the protocol and against reference motions."""
