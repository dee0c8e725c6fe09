"""Constants of nature."""

#: Acceleration of gravity [m/s^2].
GRAVITY = 9.81
