"""Results as sentences and rows, one file for each command; no HTML, no terminal codes."""
