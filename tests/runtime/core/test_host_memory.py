"""The memory of a host is the smallest limit of the machine, its control groups and the process."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest
from recipe_runtime.core import host

MACHINE = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _host(root: Path, groups: str, limits: dict[str, str]) -> Path:
    (root / "proc/self").mkdir(parents=True)
    (root / "proc/self/cgroup").write_text(groups)
    for path, text in limits.items():
        (root / "sys/fs/cgroup" / path).parent.mkdir(parents=True, exist_ok=True)
        (root / "sys/fs/cgroup" / path).write_text(text + "\n")
    return root


@pytest.mark.parametrize(
    ("groups", "limits", "total"),
    [
        ("0::/user/build\n", {"user/build/memory.max": "5000000", "user/memory.max": "max"}, 5_000_000),
        ("0::/user/build\n", {"user/build/memory.max": "max", "user/memory.max": "4000000"}, 4_000_000),
        ("0::/not/seen/here\n", {"memory.max": "3000000"}, 3_000_000),
        ("0::/\n", {"memory.max": "max"}, MACHINE),
        ("4:cpu:/a\n3:memory:/a\n", {"memory/a/memory.limit_in_bytes": "2000000"}, 2_000_000),
        ("3:memory:/a\n", {"memory/memory.limit_in_bytes": "9223372036854771712"}, MACHINE),
        ("0::/a\n", {}, MACHINE),
    ],
)
def test_the_smallest_limit_applies(tmp_path: Path, groups: str, limits: dict[str, str], total: int) -> None:
    assert host.total_memory(_host(tmp_path, groups, limits)) == total


def test_a_limit_of_address_space_applies_to_each_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (700 << 20, resource.RLIM_INFINITY))
    assert host.process_memory_limit() == 700 << 20
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    assert host.process_memory_limit() is None
