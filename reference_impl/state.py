"""The layout of a state: 13 numbers, position [m], orientation [x, y, z, w], velocity [m/s], angular velocity [rad/s].

The layout is that of `dropspin.scenarios.state`, which this package cannot import; a test compares the two.
"""

POSITION = slice(0, 3)
ORIENTATION = slice(3, 7)
VELOCITY = slice(7, 10)
SPIN = slice(10, 13)
