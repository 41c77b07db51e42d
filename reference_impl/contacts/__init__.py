"""Contact treatments: `contact=…`, each a `collide(x, q, v, w, body, floor, law)` that returns (v, ω) and whether it converged.

No contact claims an order: an impact is detected at the end of the step in which it happens, up to dt late, so a motion with impacts is of
first order at best, and of none where several vertices touch and where a body comes to rest.
"""
