"""Recordings of a user's own: measured tosses of a body, what they show by themselves, and engines compared with them."""
