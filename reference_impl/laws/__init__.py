"""The impulse at a contact point: `law=…`, each an `impulse(K, u, mu, friction)`."""
