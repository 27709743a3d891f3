"""Colour palettes of town elements: kind of element -> slot -> colours to draw from, as "#rrggbb"."""

from recipe_compiler.ir.streams import Stream

# Muted, because the tone curve of the camera increases saturation.
_BRICK_TO_PLASTER = (
    "#86665a", "#957868", "#77625a", "#a38f7c", "#c2b8a6", "#d2cbbe", "#b7b4ac", "#a8a49e",
    "#b8a892", "#918a82", "#c8bca8", "#8f9396", "#b3a6a4", "#a39e8c", "#8a6f62", "#d8d4cb",
    "#b7ab92", "#a3a79a", "#a0a8ac", "#a8948a", "#b5a69e", "#775c53", "#bdb6a5", "#716d69",
)  # fmt: skip
_LEAVES = ("#51603a", "#586840", "#4b5a38", "#616b44", "#686c48")
_ASPHALTS = ("#626366", "#5d5e61", "#686867")
_PATCHES = ("#55565a", "#6f6f6e", "#505154")
_TAR = ("#3a3b3d",)
_IRON = ("#5a5552",)
_PAINT = ("#dcdcd6",)
_SIGN = {"red": ("#b3201f",), "white": ("#e6e6e2",), "blue": ("#1f4f93",), "black": ("#161616",)}

TREES: tuple[dict[str, tuple[str, ...]], ...] = (
    {},  # lime, plane
    {"leaves": ("#3a4d36", "#41533b", "#384a3c")},  # spruce
    {"leaves": ("#55663a", "#5c6a3c")},  # poplar
    {"leaves": ("#66743f", "#6d7846"), "bark": ("#c4beb2", "#b8b2a6")},  # birch
    {"leaves": ("#44573f", "#4b5a40"), "bark": ("#7a5642", "#6f5140")},  # pine
)
"""Palettes of species that differ from that of `tree`, by the species' number."""

PALETTES: dict[str, dict[str, tuple[str, ...]]] = {
    "ground": {"ground": ("#6f7466",), "wood": ("#36422c",)},
    "road": {
        "asphalt": _ASPHALTS,
        "patch": _PATCHES,
        "tar": _TAR,
        "iron": _IRON,
        "paint": _PAINT,
        "centre": ("#d9b94a",),
    },
    "junction": {"asphalt": _ASPHALTS, "patch": _PATCHES, "tar": _TAR, "iron": _IRON, "paint": _PAINT},
    "carriageway": {"asphalt": ("#6a6b6d",), "patch": ("#626365", "#5e5f62"), "tar": ("#46474a",), "paint": _PAINT},
    "parking": {"setts": ("#75716b", "#7c7771", "#6d6b68"), "paint": _PAINT},
    "path": {"path": ("#8d8780", "#938d84", "#86827c")},
    "traffic_light": {
        "metal": ("#4a4e50",),
        "housing": ("#1d1f20",),
        "red": ("#3a1512",),
        "amber": ("#3b2a10",),
        "green": ("#10301f",),
        "red_lit": ("#ff2a1a",),
        "amber_lit": ("#ffa51a",),
        "green_lit": ("#1fe08a",),
    },
    "sign": {"metal": ("#8d9194",), **_SIGN},
    "gantry": {"metal": ("#8b9093",), "blue": _SIGN["blue"], "white": _SIGN["white"], "green": ("#1f6b43",)},
    "guardrail": {"rail": ("#9a9ea0", "#8f9395")},
    "sidewalk": {
        "kerb": ("#a6a39c",),
        "slabs": ("#98948c", "#9d978d", "#938f89"),
        "yard": ("#6a7359", "#717a5d"),
        "verge": ("#6a7359",),
        "paving": ("#958d80", "#918e88", "#9c9282"),
    },
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
        "leaves": _LEAVES,
        "pit": ("#4d4339",),
        "grate": ("#3f4243",),
        "stake": ("#8a7254",),
    },
    "bush": {"leaves": _LEAVES},
    "hedge": {"leaves": ("#4a5b3a", "#51623c", "#566640")},
    "planter": {
        "pot": ("#9a958c", "#b3a893", "#7f7a73"),
        "soil": ("#3f352b",),
        "leaves": _LEAVES,
        "flowers": ("#b8433a", "#c9a43f", "#a8568a", "#d5cfc4", "#c26a3a"),
    },
    "house": {
        "wall": ("#8d6c5f", "#9c8270", "#c4beb0", "#d4d1c9", "#b6bbbc", "#a8ada2", "#c0b298", "#939ba2"),
        "trim": ("#e4e1d8", "#d8d2c4", "#c9c4b8"),
        "window": ("#3d4a54", "#46525a"),
        "frame": ("#e6e3dc", "#dcd8ce", "#4a4743"),
        "base": ("#8a857c", "#77736c", "#8f7464"),
        "door": ("#5b2c2a", "#2f4038", "#2e4257", "#4a3326"),
        "garage": ("#d9d6ce", "#b7b2a6", "#8b8a86"),
        "roof": ("#70544a", "#7a6054", "#5c5652", "#505255", "#665750"),
    },
    "fence": {"fence": ("#d6d2c6", "#3b3d40", "#8a6b4e", "#6f5a45")},
    "hydrant": {"metal": ("#a83228", "#c29a2e"), "cap": ("#c9c4b8", "#8d2a22")},
    "bollard": {"metal": ("#3d4144", "#54585b"), "band": ("#d8d5cb", "#c9a43a")},
    "bus_stop": {
        "metal": ("#4a4f53", "#5b6166"),
        "roof": ("#3b4146", "#5c6468"),
        "glass": ("#5a6a70",),
        "wood": ("#7c5a3c",),
        "sign": ("#2b4a6b", "#2f5a40"),
        "board": ("#b4503a", "#3f6d8c", "#c9a24a"),
    },
    "kiosk": {
        "wall": ("#2f4a3e", "#3c4a58", "#6b3a34"),
        "trim": ("#c8b48e", "#b9b4a8"),
        "shop": ("#8c8270",),
        "roof": ("#4b4f52",),
        "sign": ("#caa23c", "#d8d2c4"),
        "awning": ("#9a3530", "#2f5f4c", "#38547a"),
        "board": ("#b4503a", "#3f6d8c", "#c9a24a"),
    },
    "billboard": {"metal": ("#4a4f53",), "board": ("#b4503a", "#3f6d8c", "#c9a24a", "#5c7a4a", "#6f4a78")},
    "fountain": {"stone": ("#b3aa9a", "#a8a49c"), "water": ("#5f7f86",)},
    "statue": {"stone": ("#a8a197", "#8f8a83"), "bronze": ("#4f5a4c", "#4b4236"), "plate": ("#6b5a3a",)},
    "lamp": {"metal": ("#3e4346",), "lamp": ("#ffe2b0",)},
    "bench": {"wood": ("#7c5a3c", "#6d5138"), "metal": ("#3b3d40",)},
    "bin": {"metal": ("#3f5a48", "#46494c", "#3d4f63")},
    "bicycles": {
        "metal": ("#8a8d90",),
        "tyre": ("#1d1d1e",),
        "paint": ("#7a2b2b", "#2b4a6b", "#2f4f40", "#c9b458"),
        "other": ("#1f2326", "#b9b4a8", "#3f6d8c"),
    },
    "board": {"wood": ("#6d5138", "#3b3d40"), "slate": ("#23272a",), "chalk": ("#d8d6cf", "#d9c27a")},
    "cafe": {
        "metal": ("#3b3d40", "#6a6d70"),
        "top": ("#7c5a3c", "#b9b4a8", "#5c4a3a"),
        "seat": ("#7c5a3c", "#3a3d40", "#8f6f4a"),
        "cloth": ("#b8b0a0", "#8f3a34", "#3f5d50", "#c2a25a", "#4a5f7a"),
    },
    "delivery": {"wood": ("#9a7d58", "#7f6a4f"), "card": ("#a98a63", "#b59a76"), "tape": ("#8d6f4a", "#c9bfa8")},
    "letter_box": {
        "metal": ("#4a4d50",),
        "paint": ("#c9a21f", "#a32a26", "#2b4a7a"),
        "slot": ("#202224",),
        "chalk": ("#e6e3dc",),
    },
    "tower": {
        "wall": ("#8d8f90", "#a29c92", "#7f858b", "#9a8f84", "#b0aca4", "#8a7468", "#a3978a"),
        "window": ("#4b5660", "#56616a", "#46545a", "#5f676a"),
    },
}


def look(kind: str, stream: Stream) -> dict[str, str]:
    """Draw a colour for every slot of a kind of element."""
    return {slot: stream.choice(colours) for slot, colours in PALETTES[kind].items()}
