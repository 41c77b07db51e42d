"""The commands, one in each file; `main` imports them by name."""
