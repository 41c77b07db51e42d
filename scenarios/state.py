"""The layout of a state: 13 numbers, position [m], orientation [x, y, z, w], velocity [m/s], angular velocity [rad/s]."""

POSITION = slice(0, 3)
ORIENTATION = slice(3, 7)
VELOCITY = slice(7, 10)
SPIN = slice(10, 13)
RATES = slice(7, 13)
"""Velocity and angular velocity together."""

PARTS = {"position": POSITION, "orientation": ORIENTATION, "velocity": VELOCITY, "angular_velocity": SPIN}
