"""Colours of a town: for each kind of element its slots, and the colours that each may have."""

from recipe_compiler.streams import Stream

_BRICK_TO_PLASTER = (
    "#8d5a48", "#9c6b52", "#7a4f42", "#b08d6e", "#c9b79b", "#d8cdb8", "#b9b4a8", "#a8a29a",
    "#c2a487", "#94867a", "#d3bfa0", "#8e9296", "#b5a2a0", "#a99f7f",
)  # fmt: skip

PALETTES: dict[str, dict[str, tuple[str, ...]]] = {
    "ground": {"ground": ("#6f7466",)},
    "road": {"asphalt": ("#626366",), "paint": ("#dcdcd6",), "centre": ("#d9b94a",)},
    "junction": {"asphalt": ("#626366",), "paint": ("#dcdcd6",)},
    "sidewalk": {"kerb": ("#a6a39c",), "slabs": ("#98948c", "#9d978d", "#938f89"), "yard": ("#6c7a55", "#8a877f")},
    "building": {
        "wall": _BRICK_TO_PLASTER,
        "trim": ("#d9d4c8", "#c8c2b4", "#b4aea2", "#e2ded4"),
        "frame": ("#e6e3dc", "#4a4743", "#6b5a48", "#3c4a4c"),
        "window": ("#3d4a54", "#46525a", "#38444c"),
        "base": ("#8a857c", "#77736c", "#9b958a", "#5f5c58"),
        "shop": ("#3b4648", "#434b4c"),
        "sign": ("#7d2b2b", "#2b4a6b", "#2f5a40", "#caa23c", "#3a3a3e", "#a4562e", "#5c3a66"),
        "awning": ("#9a3530", "#2f5f4c", "#c7a04a", "#38547a", "#d8d2c4", "#7a3f58"),
        "door": ("#4a3326", "#2f4038", "#5b2c2a", "#39424e"),
        "roof": ("#6a6763", "#5c5754", "#77726a"),
        "metal": ("#3d3f42", "#55585a"),
    },
    "wall": {"wall": ("#a39380", "#9a7662", "#b0a695"), "coping": ("#bdb7ab", "#a9a59c")},
    "tree": {
        "bark": ("#5b4a3b", "#665546", "#4f443a"),
        "leaves": ("#45552f", "#4c5d33", "#3f4f2c", "#566338", "#5d6339"),
        "pit": ("#4d4339",),
    },
    "lamp": {"metal": ("#3e4346",), "lamp": ("#ffe2b0",)},
    "bench": {"wood": ("#7c5a3c", "#6d5138"), "metal": ("#3b3d40",)},
    "bin": {"metal": ("#3f5a48", "#46494c", "#3d4f63")},
    "tower": {"wall": ("#8d8f90", "#a29c92", "#7f858b", "#9a8f84", "#b0aca4"), "window": ("#4b5660", "#56616a")},
}


def look(kind: str, stream: Stream) -> dict[str, str]:
    """A colour for every slot of a kind, drawn from the stream."""
    return {slot: stream.choice(colours) for slot, colours in PALETTES[kind].items()}
