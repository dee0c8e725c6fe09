"""Contact schedules: found on a clip, edited, saved."""

from gmr_traj.contacts.detect import detect as detect
