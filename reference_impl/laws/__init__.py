"""Impact laws, the impulse at one contact point: `law=…`, each an `impulse(K, u, mu, friction)`.

A law maps the velocities before an impact to those after it. The time step has no effect, so the order of accuracy is infinite: a law is
exact for the impact that it models, and its error is a model error.
"""
