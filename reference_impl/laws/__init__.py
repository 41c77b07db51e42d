"""Impact laws, the impulse at one contact point: `law=…`, each an `impulse(K, u, mu, friction)`.

A law maps velocities to velocities at one instant. No time step enters it, so its order of accuracy is infinite: a law is exact for the
impact that it models, and its error is a model error.
"""
