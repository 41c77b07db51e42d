"""Data to words and rows, one command a file; no HTML, no terminal codes."""
