"""Eq 15: the change of the velocity of a point of the body by an impulse at that point."""

from dropspin.reference_impl.vectors import Mat3, Vec3, compiled, cross, transpose


@compiled
def impulse_response(r, I_inverse, mass):
    """Eq 15: K = 1/M − r* I⁻¹ r*, the velocity that a unit impulse gives to the point on which it acts.

    The products with r* are taken row by row as cross products, a* r* = a × r: multiplying by the zeros of eq 14 would take a third of the
    step.
    """
    turned = transpose(Mat3(cross(r, I_inverse.row1), cross(r, I_inverse.row2), cross(r, I_inverse.row3)))  # r* I⁻¹
    m = 1.0 / mass
    return Mat3(
        Vec3(m, 0.0, 0.0) - cross(turned.row1, r),
        Vec3(0.0, m, 0.0) - cross(turned.row2, r),
        Vec3(0.0, 0.0, m) - cross(turned.row3, r),
    )
