"""Many photos' colors of a point to one."""
