"""What gmr-traj takes: measurements in fresh processes, beside a frame-by-frame retargeter written with mink."""
