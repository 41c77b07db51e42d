"""The fuzz campaign, `make fuzz`: inputs that no user means, and what must hold after every command.

`FUZZ_CASES` is the number of cases of all tests together, `FUZZ_SEED` the seed of their choice. The suite runs a few with seed 0.
"""
