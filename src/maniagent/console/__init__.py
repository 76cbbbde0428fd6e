"""What people see of a run: the live display, the run folder, the video and the report."""
