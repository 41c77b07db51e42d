"""Diagnosis of a user's model: what an engine makes of it, and what its settings do, measured against exact solutions."""
