"""Terminal output: untrusted text is escaped in one place, errors have one form, colour follows the conventions."""

from __future__ import annotations

import ast
import io
import json
import re
import unicodedata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from recipe_cli import console, diagnostics
from recipe_cli.commands import check, plan, verify
from recipe_cli.console import Styled, in_colour, safe, say
from recipe_compiler.ir import lockfile
from recipe_compiler.ir.errors import Code, InputError, Place, Problem, printable, split_remedy

from tests.cli.runner import run_here
from tests.cli.test_small_files import on_a_terminal
from tests.sources import ROOT, modules, walk

CLI = ROOT / "cli" / "recipe_cli"
ATTACKS = {
    "escape code": "\x1b[2J\x1b[32mPASS\x1b[0m",
    "C1 control": "\x9b31mPASS",
    "carriage return": "x\rPASS small@sha256:00",
    "line break": "x\nPASS  small@sha256:00",
    "line separator": "x\u2028PASS",
    "bidi override": "x\u202eSSAP",
    "zero width": "PA\u200bSS",
    "filler": "PA\u3164SS",
    "variation selector": "PASS\ufe0f",
    "backspace": "FAIL\b\b\b\bPASS",
    "surrogate": "PASS\udc80",
}


@pytest.mark.parametrize("text", ATTACKS.values(), ids=ATTACKS)
def test_control_and_invisible_characters_are_escaped(text: str) -> None:
    shown = printable(text)
    assert shown != text and shown.isprintable() and "\\" in shown


@pytest.mark.slow
@given(st.text())
def test_escaping_gives_one_printable_line_and_is_idempotent(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable() and len(shown.splitlines()) <= 1
    assert not any(unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") for c in shown)
    assert printable(shown) == shown
    if text.isascii() and text.isprintable():
        assert shown == text


def test_letters_of_every_script_are_not_escaped() -> None:
    for text in ("Straßenbahn", "横断歩道", "перехід", "ábc", "😀", "שלום"):
        assert printable(text) == text


@pytest.mark.parametrize("text", [*ATTACKS.values(), "PASS  small@sha256:00", "error[x]: y"])
def test_no_text_can_imitate_the_line_of_a_verdict(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    say(text)
    (line,) = capsys.readouterr().out.splitlines()
    assert not re.match(r"(PASS|FAIL|INCONCLUSIVE)\b|error\[", line)
    say(Styled("PASS", "green"), "  small.yaml")
    assert capsys.readouterr().out == "PASS  small.yaml\n"


def test_a_long_text_is_continued_indented_on_a_terminal() -> None:
    program = "from recipe_cli.console import say\nsay('x: ' + 'word ' * 14 + ' PASS  small@sha256:00 and more')"
    lines = on_a_terminal(program, 72).splitlines()
    assert len(lines) > 1 and all(line.startswith("    ") for line in lines[1:])
    assert max(map(len, lines)) <= 72


HOSTILE = "calm\x1b[2J\nPASS  small@sha256:" + "0" * 64
RECIPE = {
    "recipe": "small",
    "description": HOSTILE,
    "base": {
        "clock": {"fps": 10, "frames": 2},
        "town": {"name": "plaza"},
        "sensors": {"street": {"mount": {"z": 2}, "camera": {"width": 16, "height": 16}, "capture": ["rgb"]}},
    },
}


@pytest.mark.parametrize("options", [[], ["--json"], ["--variant", "base"]])
def test_a_description_cannot_imitate_a_verdict(options: list[str], tmp_path: Path) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(json.dumps(RECIPE))
    done = CliRunner().invoke(plan.command, [str(path), *options], catch_exceptions=False)
    assert done.exit_code == 0 and (options or "calm" in done.stdout)
    assert "\x1b" not in done.output
    assert not any(line.startswith("PASS") for line in done.output.splitlines())


@pytest.mark.parametrize("text", ATTACKS.values(), ids=ATTACKS)
def test_json_output_is_escaped_without_changing_its_value(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    console.print_json({"text": text})
    out = capsys.readouterr().out
    assert all(line.isprintable() for line in out.splitlines())
    assert json.loads(out)["text"] == text


# Printing

PRINTERS = {"echo", "secho", "echo_via_pager", "print", "pprint", "write", "writelines", "progressbar"}


def printing(source: str) -> list[int]:
    """Return the lines of a program that print without the console module."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in PRINTERS or (name == "show" and isinstance(node.func, ast.Attribute)):
                found.append(node.lineno)
    return found


def test_only_the_console_prints() -> None:
    allowed = {"console.py": {"echo"}, "progress.py": {"progressbar"}}
    for path in sorted(CLI.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        wrong = [
            lines[n - 1].strip()
            for n in printing(text)
            if not any(f"click.{name}(" in lines[n - 1] for name in allowed.get(path.name, ()))
            and "made.write(" not in lines[n - 1]  # (pictures, lockfiles and traces are files)
            and "trace_bundle.write(" not in lines[n - 1]
        ]
        assert not wrong, f"{path.relative_to(ROOT)}: print with console.say: {wrong}"


# The form of errors


def test_an_error_has_its_code_place_source_line_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    source = "  clock: {fsp: 10, frames: 60}"
    problem = Problem(
        'unknown key "fsp"', Place("r.yaml", 12, 11), 'did you mean "fps"?', Code.UNKNOWN_KEY, "n", source
    )
    diagnostics.print_problems("error", [problem])
    assert capsys.readouterr().err == (
        'error[unknown-key]: unknown key "fsp"\n'
        "  --> r.yaml:12:11\n"
        "   |\n"
        "12 |   clock: {fsp: 10, frames: 60}\n"
        "   |           ^^^\n"
        "note: n\n"
        'help: did you mean "fps"?\n'
    )


@given(st.text(max_size=300), st.integers(1, 400))
def test_the_caret_is_under_the_column(source: str, column: int) -> None:
    text, caret = diagnostics._excerpt(source, column)
    assert text.isprintable() and set(caret) <= {" ", "^"}
    assert console.width(text) <= 8 * (diagnostics._BEFORE + diagnostics._AFTER + 4) * 2
    if column <= len(source) and not source[column - 1].isspace():
        assert caret.count("^") >= 1 and console.width(text) >= len(caret) - caret.count("^")


def test_at_most_fifty_errors_are_shown_and_the_rest_counted(capsys: pytest.CaptureFixture[str]) -> None:
    diagnostics.print_problems("error", [Problem(f"wrong {n}") for n in range(73)])
    lines = capsys.readouterr().err.splitlines()
    assert sum(line.startswith("error[") for line in lines) == 50
    assert lines[-1] == "error: and 23 errors more; --json lists all"


def test_a_remedy_is_separated_from_its_message_outside_quotes_and_brackets() -> None:
    assert split_remedy("a is wrong; write b") == ("a is wrong", "write b")
    assert split_remedy('"x; y" is wrong') == ('"x; y" is wrong', None)
    assert split_remedy("'x; y' is wrong; write z (or w; v)") == ("'x; y' is wrong", "write z (or w; v)")
    assert split_remedy("the dataset's file; build the user's again") == (
        "the dataset's file",
        "build the user's again",
    )
    problem = Problem("a is wrong; write b", Place("f", 1, 2))
    assert (problem.message, problem.help, str(problem)) == ("a is wrong", "write b", "f:1:2: a is wrong; write b")


class _Stream(io.StringIO):
    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal


@pytest.mark.parametrize(
    ("environment", "pipe", "terminal"),
    [
        ({}, False, True),
        ({"NO_COLOR": "1"}, False, False),
        ({"FORCE_COLOR": "1"}, True, True),
        ({"CLICOLOR": "0"}, False, False),
        ({"TERM": "dumb"}, False, False),
        ({"NO_COLOR": "1", "FORCE_COLOR": "1"}, False, False),
    ],
)
def test_colour_follows_the_conventions(environment: dict[str, str], pipe: bool, terminal: bool) -> None:
    assert (in_colour(_Stream(False), environment), in_colour(_Stream(True), environment)) == (pipe, terminal)


@pytest.mark.parametrize(("verdict", "code"), [("PASS", 32), ("FAIL", 31), ("INCONCLUSIVE", 33)])
def test_verdicts_have_their_colours(
    verdict: str, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.delenv("NO_COLOR", raising=False)
    report: Any = SimpleNamespace(
        verdict=verdict, stage="", identity="i", differences=(), notes=(), pictures=(), extent="e", nonce=1, files=None
    )
    verify._say(Path("r.yaml"), report)
    assert capsys.readouterr().out.startswith(f"\x1b[{code}m\x1b[1m{verdict}\x1b[0m  r.yaml\n")


# JSON


FAILING = {
    "init": ["a/b"],
    "check": ["gone.yaml"],
    "plan": ["gone.yaml"],
    "shot": ["gone.yaml"],
    "build": ["gone.yaml"],
    "lock": ["gone.yaml"],
    "verify": ["gone.yaml"],
    "diff": ["gone.yaml", "gone.yaml"],
    "pack": ["gone.yaml"],
    "export": ["gone", "out"],
    "cache": ["--size", "1G"],
    "blueprints": ["dragon.*"],
    "surfaces": ["dragon.*"],
    "schema": ["-o", "gone/x.json"],
    "doctor": ["--never"],
}


@pytest.mark.slow
@pytest.mark.parametrize("command", FAILING)
def test_with_json_the_errors_of_every_command_are_one_document(command: str, tmp_path: Path) -> None:
    done = run_here(command, *FAILING[command], "--json", cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert (done.returncode, done.stderr) == (2, "")
    (error,) = answer["errors"]
    assert error["message"] and error["code"] in set(Code)
    assert set(error) == {"code", "message", "help", "note", "file", "line", "column"}
    assert answer["warnings"] == []


def test_with_json_the_document_includes_warnings(tmp_path: Path) -> None:
    twins = {n: {"blueprint": "walker.pedestrian.0001", "start": {"x": 8, "y": 5}} for n in ("a", "b")}
    document = {**RECIPE, "base": {**RECIPE["base"], "actors": twins}}  # type: ignore[dict-item]  # RECIPE is a plain dict
    (tmp_path / "r.yaml").write_text(json.dumps(document))
    for command in (check.command, plan.command):
        done = CliRunner().invoke(command, [str(tmp_path / "r.yaml"), "--json"], catch_exceptions=False)
        answer = json.loads(done.stdout)
        assert (done.exit_code, done.stderr, answer["errors"]) == (0, "", [])
        (warning,) = answer["warnings"]
        assert (warning["code"], warning["line"], warning["help"]) == ("placement", 1, "move one of them")
    done = CliRunner().invoke(plan.command, [str(tmp_path / "r.yaml")], catch_exceptions=False)
    assert done.stderr.startswith("warning[placement]: actors.b.start: its body overlaps the body of a\n --> ")


def test_an_unexpected_exception_is_escaped_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from recipe_cli import main

    problems, code = main._explained(KeyError("\x1b[31mPASS"))
    assert code == 1 and problems[0].code == Code.INTERNAL
    assert "\x1b" not in capsys.readouterr().err


def test_urls_are_masked_where_the_command_line_prints() -> None:
    assert safe("see https://host/x?sig=abc: gone") == "see https://host/x?***: gone"
    assert safe("s3://KEY:se/cret@bucket/x") == "s3://KEY:***@bucket/x"
    assert safe("try 'x' with --dir http:/user:secret@host") == "try 'x' with --dir http:/user:***@host"


@pytest.mark.slow
def test_the_library_names_no_command_line_options() -> None:
    """Users of Python see its problems too; `diagnostics` adds options. A card names options, and git has its own."""
    seen = 0
    for path, tree in (*modules("recipe_compiler"), *modules("recipe_runtime")):
        scopes = [node for node in walk(tree) if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))]
        docstrings = {id(scope.body[0].value) for scope in scopes if scope.body and isinstance(scope.body[0], ast.Expr)}
        for node in walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                seen += 1
                if path not in ("recipe_runtime/dataset/card.py", "recipe_runtime/lifecycle/history.py"):
                    assert not re.search(r"(?<![-\w])--[a-z]", node.value), f"{path}: {node.value}"
    assert seen > 1000


@pytest.mark.parametrize(
    ("remedy", "shown"),
    [
        ("choose another folder, or replace it", "choose another folder (--output), or replace it (--replace)"),
        ("choose a folder in it, such as x", "choose a folder (--output) in it, such as x"),
    ],
)
def test_options_are_added_to_the_remedies_of_output_in_the_way(remedy: str, shown: str) -> None:
    assert diagnostics.remedy(Problem("x is in the way", help=remedy, code=Code.OUTPUT_IN_THE_WAY)) == shown
    assert diagnostics.remedy(Problem("x is damaged", help=remedy)) == remedy
    assert diagnostics.remedy(Problem("x is in the way", help="wait", code=Code.OUTPUT_IN_THE_WAY)) == "wait"


def test_the_command_that_writes_a_lockfile_again_is_added() -> None:
    """Regression: the remedy named `recipe lock`, which refuses to replace a damaged lockfile."""
    with pytest.raises(InputError) as caught:
        lockfile.loads("recipe-lock 1\nbananas 3\n", "x.lock")
    help = "restore the file from a copy, or write it again (`recipe lock --update`)"
    assert diagnostics.remedy(caught.value.problems[0]) == help


def test_a_remedy_that_problems_share_is_printed_once(capsys: pytest.CaptureFixture[str]) -> None:
    """`build --locked` reports each difference from the lockfile, and one command updates it."""
    help = "`recipe lock --update` locks the recipe's current content"
    found = [Problem(f"a.lock: plan: {n}", help=help, code=Code.OUTDATED_LOCKFILE) for n in range(3)]
    diagnostics.print_problems("error", [*found, Problem("b.lock is gone", help="copy it", code=Code.FILE_NOT_FOUND)])
    assert capsys.readouterr().err.splitlines() == [
        *(f"error[outdated-lockfile]: a.lock: plan: {n}" for n in range(3)),
        f"help: {help}",
        "",
        "error[file-not-found]: b.lock is gone",
        "help: copy it",
    ]
