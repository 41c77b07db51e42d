"""Helpers and fixtures that tests share: engines made for tests, the command line, results computed once a session."""
