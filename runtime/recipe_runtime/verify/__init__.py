"""Lockfiles, verification, differences and the self-test."""
