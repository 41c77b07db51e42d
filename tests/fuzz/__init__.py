"""The fuzz campaign, `make fuzz`: inputs that no user means, and what holds for every command whatever it is given.

`FUZZ_CASES` is the number of cases of all tests together, `FUZZ_SEED` the seed of their choice. By default the suite runs a few with seed 0.
"""
