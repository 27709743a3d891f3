"""URLs as they may be shown: without passwords, tokens and signatures.

A URL may hold a secret as the password before `@`, as a long user name (a token), in its query (`?sig=...`), in
parameters of its path (`;sig=...`), or in its fragment. Passwords of S3 URLs contain unescaped `/` and `@`, so
everything up to the last `@` is taken for the password. A path library may have merged slashes, so one slash begins a
URL as two do. Where a part may or may not be a secret it is masked.
"""

from __future__ import annotations

import re
from urllib.parse import unquote

MASK = "***"

_URL = re.compile(r"(?P<start>(?P<scheme>[A-Za-z][A-Za-z0-9+.-]{0,40}):/+)(?P<rest>\S*)")
_PASSWORD = re.compile(r"([^/:@]*?)(?::|%3A)(.*)@", re.IGNORECASE)
_TOKEN = re.compile(r"([^/@]{20,})@")  # a user name so long is a token
_PARAMETERS = re.compile(r";[^;?#]*=[^?#]*")
_QUERY = re.compile(r"([?#])[^#]+")
_PATHS = {"file", "local"}  # URLs of these are paths alone
_END = "'\"`:;,.)]}>"  # punctuation of the sentence around a URL
_MIN_SECRET = 4  # shorter texts are masked within their URL only


def without_secrets(text: str, *urls: str) -> str:
    """Text with the secrets of all URLs in it masked: `ftp://user:***@host/x?***` for `ftp://user:pw@host/x?sig=1`.

    Args:
        text: a URL, or text with some, such as a library's error.
        urls: further URLs, whose secrets are masked wherever they occur in the text, with or without their URL.
    """
    found = {secret for url in urls for secret in _secrets(url)}
    for secret in sorted(found, key=len, reverse=True):
        text = text.replace(secret, MASK)
    return _URL.sub(lambda match: _masked(match, _END), text)


def shown(url: str) -> str:
    """One whole URL, to be shown; its white space is part of it."""
    return _URL.sub(_masked, re.sub(r"\s", "%20", url))


def _masked(match: re.Match[str], end: str = "") -> str:
    """A URL without its secrets; characters of `end` after it are no part of it."""
    own = match["rest"].rstrip(end) if end else match["rest"]
    user, secret, place = _split(match["scheme"], own)
    head = "" if secret is None else f"{user}:{MASK}@" if user else f"{MASK}@"
    place = _QUERY.sub(rf"\1{MASK}", _PARAMETERS.sub(f";{MASK}", place))
    return f"{match['start']}{head}{place}{match['rest'][len(own) :]}"


def _split(scheme: str, rest: str) -> tuple[str, str | None, str]:
    """User, password or token, and the rest of a URL after `://`."""
    if scheme.lower() in _PATHS:
        return "", None, rest
    if found := _PASSWORD.match(rest):
        return found[1], found[2], rest[found.end() :]
    if found := _TOKEN.match(rest):
        return "", found[1], rest[found.end() :]
    return "", None, rest


def _secrets(url: str) -> set[str]:
    """The secrets of a URL, as written and decoded."""
    found: set[str] = set()
    for match in _URL.finditer(url):
        _, secret, place = _split(match["scheme"], match["rest"])
        parts = re.split(r"[?;&#]", place)[1:]
        found |= {secret or "", *parts, *(part.partition("=")[2] for part in parts)}
        for text in (secret or "", unquote(secret or "")):
            found |= set(re.split(r"[]/?#@:[]", text))  # libraries quote a part of a URL, up to one of these
    found |= {unquote(secret) for secret in found}
    return {secret for secret in found if len(secret) >= _MIN_SECRET}
