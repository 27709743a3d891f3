"""Examples of the use of Dataset Recipe."""
