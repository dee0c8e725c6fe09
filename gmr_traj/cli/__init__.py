"""The command `gmr-traj`."""
