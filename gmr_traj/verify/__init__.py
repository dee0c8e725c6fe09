"""Can the robot follow this? An audit of the dynamics a clip asks for, and tracking rollouts in MuJoCo."""
