"""Minutes of traffic in every town, measured from plan and Trace alone. `python -m tests.soak` prints the table."""
