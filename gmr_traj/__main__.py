"""Run the command as `python -m gmr_traj`."""

import sys

from gmr_traj.cli.main import main

sys.exit(main())
