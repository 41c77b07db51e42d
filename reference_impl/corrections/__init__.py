"""Position corrections after the step: `correction=…`, each a `correct(x, q, body, floor)`."""
