"""Faults that an engine or its adapter may have: models of wrong conventions and wrong parameters, whose exact motion is known."""
