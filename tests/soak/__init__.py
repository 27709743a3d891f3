"""Minutes of traffic in every town, measured from plan and Trace only. `python -m tests.soak` prints the table."""
