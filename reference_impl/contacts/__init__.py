"""Where the floor acts: `contact=…`, each a `collide(x, q, v, w, body, floor, law)`."""
