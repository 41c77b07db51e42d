"""Rotations over one step: `rotation=…`, each a `turn(q, w, dt, body)` that returns (q, ω); `methods.py` lists them."""
