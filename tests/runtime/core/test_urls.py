"""Secrets in URLs are masked wherever a URL is shown, also in errors of libraries."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from recipe_compiler.ir.errors import InputError, RunError
from recipe_runtime.core import urls
from recipe_runtime.transfer.stores import reported_errors

MASKED = {
    "s3://KEY:sec/ret@bucket/name": "s3://KEY:***@bucket/name",
    "s3://KEY:12/secret@bucket/name": "s3://KEY:***@bucket/name",
    "ftp://user:p@ss@host/x": "ftp://user:***@host/x",
    "https://user:p@ss/word@host/x": "https://user:***@host/x",
    "az://box/x?sv=2024&sig=a%2Fb": "az://box/x?***",
    "https://host/x?token=t#part": "https://host/x?***#***",
    "https://host/x#access_token=t": "https://host/x#***",
    "https://ghp_0123456789abcdefghij@host/x": "https://***@host/x",
    "simplecache::s3://KEY:se/cret@bucket/x": "simplecache::s3://KEY:***@bucket/x",
    "zip://in.json::https://host/a.zip?sig=abcd": "zip://in.json::https://host/a.zip?***",
    "https://user%3Asecret@host/x": "https://user:***@host/x",
    "s3://KEY%3asec/ret@bucket/name": "s3://KEY:***@bucket/name",
    "https://host/x;sig=secret": "https://host/x;***",
    "https://host/x;v=1;sig=sec/ret?a=b": "https://host/x;***?***",
    "https:/user:secret@host/x": "https:/user:***@host/x",
    "cannot open 'https://host/x?sig=abcd': gone": "cannot open 'https://host/x?***': gone",
}
KEPT = (
    "s3://bucket/a:b@c",
    "ftp://user@host:21/x",
    "file:///a:b@c",
    "file:/a:b@c",
    "s3:/bucket/a:b@c",
    "https://host/a;b/c",
    "at https://host/x; try again",
    "a/b:c@d",
    "is https://host/x? yes",
    "(see https://host/x.)",
)


@pytest.mark.parametrize(("text", "shown"), MASKED.items())
def test_secrets_are_masked(text: str, shown: str) -> None:
    assert urls.without_secrets(text) == shown
    assert urls.without_secrets(shown) == shown


@pytest.mark.parametrize("text", KEPT)
def test_other_text_is_not_masked(text: str) -> None:
    assert urls.without_secrets(text) == text


def test_long_words_are_masked_in_little_time() -> None:
    """They took 17 s each when the time was quadratic."""
    assert urls.without_secrets("a" * 60_000 + " ://") == "a" * 60_000 + " ://"
    assert urls.without_secrets("a" * 60_000 + "://u:secret@host") == "a" * 60_000 + "://u:***@host"
    assert urls.without_secrets("a://" + "'" * 60_000 + "x") == "a://" + "'" * 60_000 + "x"


_SECRET = st.text("abcXYZ019/+=@:%._~-", min_size=6, max_size=40).filter(lambda t: any(c.isalpha() for c in t))


@pytest.mark.slow
@given(_SECRET, st.sampled_from(["s3", "gs", "abfs"]))
def test_no_part_of_a_password_is_shown(secret: str, scheme: str) -> None:
    url = f"{scheme}://KEY:{secret}@bucket/name"
    assert urls.shown(url) == f"{scheme}://KEY:***@bucket/name"
    message = f"no such place: KEY:{secret}@bucket/name"  # as in a library's message, without the scheme
    assert secret not in urls.without_secrets(message, url)


@pytest.mark.parametrize("delimiter", "/?#@:[]")
@pytest.mark.parametrize("scheme", ["s3", "ftp"])
def test_the_part_of_a_password_that_a_library_quotes_is_masked(scheme: str, delimiter: str) -> None:
    """Libraries split a URL at these characters, and quote the first part: "invalid bucket name 'KEY:wJalr'"."""
    url = f"{scheme}://KEY:wJalr{delimiter}XUtn@bucket/name"
    text = urls.without_secrets("invalid bucket name 'KEY:wJalr'; the path is 'XUtn'", url)
    assert text == "invalid bucket name 'KEY:***'; the path is '***'"
    escaped = f"{scheme}://KEY:wJalr%{ord(delimiter):02X}XUtn@bucket/name"
    assert urls.without_secrets("wJalr and XUtn", escaped) == "*** and ***"


@given(_SECRET, st.sampled_from(["s3", "az", "https"]))
@example("0000/X", "https")
def test_a_password_is_masked_with_an_escaped_colon_or_one_slash(secret: str, scheme: str) -> None:
    for start in (f"{scheme}://KEY%3A", f"{scheme}:/KEY:", f"{scheme}:/KEY%3a"):
        url = f"{start}{secret}@bucket/name"
        assert urls.shown(url).endswith(":***@bucket/name")
        assert secret not in urls.without_secrets(f"no such place: {secret}", url)


@given(_SECRET)
def test_no_part_of_a_signature_in_a_path_is_shown(secret: str) -> None:
    url = f"https://host/x;sig={secret}"
    assert urls.shown(url) == "https://host/x;***"
    assert secret not in urls.without_secrets(f"refused: {secret}", url)


@pytest.mark.parametrize("kind", [ValueError, PermissionError, ConnectionError, ImportError])
def test_an_error_of_a_library_shows_no_secret(kind: type[Exception]) -> None:
    url = "s3://KEY:wJalr/XUtn@bucket/x?sig=abcdef"
    with pytest.raises((InputError, RunError)) as caught, reported_errors(url, "try again"):
        raise kind("403 for KEY:wJalr/XUtn@bucket, sig abcdef, at https://bucket/x?sig=abcdef&k=v")
    text = str(caught.value)
    assert "s3://KEY:***@bucket/x?***" in text
    assert not any(secret in text for secret in ("wJalr", "XUtn", "abcdef"))
