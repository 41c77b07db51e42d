"""Contact treatments: `contact=…`, each a `collide(x, q, v, w, body, floor, law)` that returns (v, ω) and whether it converged.

No contact treatment claims an order. An impact is detected at the end of the time step in which it occurs, up to dt late. A motion with
impacts is therefore of first order at best, and has no order if several vertices touch or if a body comes to rest.
"""
