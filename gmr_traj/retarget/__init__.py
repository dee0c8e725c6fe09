"""From a human motion to a robot motion: body maps, scaled targets, inverse kinematics frame by frame."""
