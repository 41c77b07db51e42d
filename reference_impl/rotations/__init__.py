"""How a body turns: `rotation=…`, each a `turn(q, w, dt, body)`."""
