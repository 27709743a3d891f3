"""The one door to entropy: a verifier's nonce. Nothing that reaches a dataset's bytes comes through here."""

import secrets


def fresh_nonce() -> int:
    """A number that the maker of a dataset could not have foreseen."""
    return secrets.randbits(53)
