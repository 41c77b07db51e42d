"""The record: every release of each engine, run in an environment of its own."""
