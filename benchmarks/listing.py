"""`make bench`: frames per second of the paper's listing and of a town, compared with a plain PyBullet script.

Each contender runs alone in its own process. Start-up and steady-state times are reported separately.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from recipe_compiler.compile import compile_recipe
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_runtime.core.trace import Trace
from recipe_runtime.frames.engines import real_engines
from recipe_runtime.frames.source import SceneSource

from benchmarks import simulation
from benchmarks.stage import write_stage
from benchmarks.table import text_of

ROOT = Path(__file__).resolve().parent.parent
RECIPE = ROOT / "recipes" / "paper" / "two_pedestrians.yaml"
WEATHERS = ROOT / "benchmarks" / "weathers.yaml"
TOWN, TOWN_VARIANT = ROOT / "benchmarks" / "town.yaml", "weather=clear"
TURNS = 3  # of one worker and two
FIRST, FURTHER = "weather=sunny", ("weather=rainy", "weather=foggy")
BASELINES = {
    "TinyRenderer, shadows": ("tiny", "1"),
    "TinyRenderer, default": ("tiny", "default"),
    "EGL on llvmpipe": ("egl", "default"),
}
STAGED = {"listing": (RECIPE, FIRST), "listing, rainy": (RECIPE, FURTHER[0]), "town": (TOWN, TOWN_VARIANT)}
Result = dict[str, Any]


def main() -> None:
    """Measure, and print a table or JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.listing", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    parser.add_argument("--frames", type=int, default=300, help="of our builds of one weather (default: 300)")
    parser.add_argument("--weather-frames", type=int, default=150, help="of our builds of two weathers (default: 150)")
    parser.add_argument("--twelve-frames", type=int, default=30, help="of our builds of twelve weathers (default: 30)")
    parser.add_argument("--town-frames", type=int, default=120, help="of our builds of the town (default: 120)")
    parser.add_argument("--slow-frames", type=int, default=12, help="of the plain script (default: 12)")
    parser.add_argument(
        "--cold", action="store_true", help="also compile the kernels afresh, and say how long it takes"
    )
    arguments = parser.parse_args()
    dataset = compile_recipe(RECIPE).plan
    with tempfile.TemporaryDirectory(prefix="recipe-bench-") as folder:
        found = measure(dataset, Path(folder), arguments)
    print(json.dumps(found, indent=2) if arguments.json else text_of(found))


def measure(dataset: DatasetPlan, folder: Path, arguments: argparse.Namespace) -> Result:
    """Measure every figure."""
    load = [round(x, 2) for x in os.getloadavg()]
    scenario = next(v for v in dataset.variants if v.variant == FIRST)
    trace = real_engines().simulate(scenario.scene)
    found: Result = {"machine": machine(), "load before": load, "ours": {}, "plain": {}, "skipped": []}
    if arguments.cold:
        found["cold start"] = cold_start(folder)
    warm_up(dataset, trace)
    rates: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(TURNS):  # alternating, because the speed of a shared machine changes within minutes
        for workers in (1, 2):
            row = ours(RECIPE, folder / f"w{workers}-{turn}", [FIRST], arguments.frames, workers)
            rates[workers].append(row["rate"])
            found["ours"][f"{workers} worker{'s' * (workers > 1)}"] = row
    found["workers"] = [two / one for one, two in zip(rates[1], rates[2], strict=True)]
    found["further"] = further(folder, arguments.weather_frames)
    found["twelve"] = twelve(folder, arguments.twelve_frames)
    found["plain"], found["skipped"] = plain(folder / "listing", scenario, trace, arguments.slow_frames)
    town = compile_recipe(TOWN).plan.variants[0]
    found["town"] = {}
    for workers in (1, 2):
        frames = arguments.town_frames // (3 - workers)
        name = f"{workers} worker{'s' * (workers > 1)}"
        found["town"][name] = ours(TOWN, folder / f"town{workers}", [TOWN_VARIANT], frames, workers)
    trace = real_engines().simulate(town.scene)
    found["town plain"], _ = plain(folder / "town", town, trace, arguments.slow_frames // 2)
    found["kernels"] = {name: kernels(recipe, variant) for name, (recipe, variant) in STAGED.items()}
    found["simulation"] = {str(size): simulation.measured(size) for size in simulation.SIZES}
    found["textures"] = last_line(run([sys.executable, "-m", "benchmarks.textures"]))
    found["load after"] = [round(x, 2) for x in os.getloadavg()]
    return found


def further(folder: Path, frames: int) -> Result:
    """Cost of an additional weather of the scene, measured alternately: seconds per frame, and share of the first."""
    found: Result = {name: {"seconds": [], "shares": []} for name in FURTHER}
    for turn in range(TURNS):
        first = ours(RECIPE, folder / f"first-{turn}", [FIRST], frames, 1)["steady"]
        for name in FURTHER:
            more = ours(RECIPE, folder / f"{name}-{turn}", [FIRST, name], frames, 1)["steady"] - first
            found[name]["seconds"].append(more / frames)
            found[name]["shares"].append(more / first)
    return found


def twelve(folder: Path, frames: int) -> Result:
    """Steady-state seconds of twelve weathers in one build, and of each in its own build."""
    names = [variant.variant for variant in compile_recipe(WEATHERS).plan.variants]
    alone = [ours(WEATHERS, folder / name, [name], frames, 1)["steady"] for name in names]
    return {"together": ours(WEATHERS, folder / "twelve", names, frames, 1)["steady"], "alone": alone}


def warm_up(dataset: DatasetPlan, trace: Trace) -> None:
    """Compile every kernel that a variant needs."""
    for variant in dataset.variants:
        list(SceneSource(variant.scene, trace).make(variant.rig.sensors[0], [variant.appearance], [0]))


def cold_start(folder: Path) -> float:
    """Seconds to the first picture with an empty cache, including the compilation of all kernels."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cold"), "RECIPE_CACHE": str(folder / "cold" / "store")}
    code = (
        "import sys, time; start = time.perf_counter(); from pathlib import Path\n"
        "from recipe_compiler.compile import compile_recipe; from recipe_runtime.frames.shot import shot\n"
        "shot(compile_recipe(Path(sys.argv[1])).plan.variants[1], frame=0); print(time.perf_counter() - start)"
    )
    return float(run([sys.executable, "-c", code, str(RECIPE)], environment).splitlines()[-1])


def kernels(recipe: Path, variant: str) -> Result:
    """Milliseconds per frame, by stage of the renderer."""
    return last_line(run([sys.executable, "-m", "benchmarks.kernels", str(recipe), variant]))


def plain(folder: Path, scenario: ScenarioPlan, trace: Trace, frames: int) -> tuple[Result, list[str]]:
    """Results of the plain script with every renderer, and the renderers that do not run here."""
    folder.mkdir()
    write_stage(scenario, trace, folder)
    found: Result = {}
    skipped = []
    for name, (renderer, shadow) in BASELINES.items():
        result = baseline(folder, folder / f"{renderer}-{shadow}", renderer, shadow, frames)
        if result is None:
            skipped.append(f"{name}: it does not run here (it needs libegl1 and libgl1-mesa-dri)")
        else:
            found[name] = result
    return found, skipped


def ours(recipe: Path, folder: Path, variants: list[str], frames: int, workers: int) -> Result:
    """Run a real build; `steady` is its wall-clock time without start-up."""
    folder.mkdir()
    command = [sys.executable, "-m", "benchmarks.ours", str(recipe), str(folder), "--variants", *variants]
    found = last_line(run([*command, "--frames", str(frames), "--workers", str(workers)]))
    found["steady"] = found["wall"] - found["start_up"]
    found["fps"] = found["frames"] / found["steady"]
    return found


def baseline(stage: Path, out: Path, renderer: str, shadow: str, frames: int) -> Result | None:
    """Run the plain script; None if it cannot run. A crash in a driver ends only its process."""
    command = [sys.executable, "-m", "benchmarks.baseline", str(stage), str(out), "--renderer", renderer]
    try:
        found = last_line(run([*command, "--shadow", shadow, "--frames", str(frames)]))
    except subprocess.CalledProcessError:
        if renderer == "egl":
            return None
        raise
    found["start_up"] = found["seconds"].pop("load")
    found["steady"] = sum(found["seconds"].values())
    found["fps"] = found["frames"] / found["steady"]
    return found


def run(command: list[str], environment: dict[str, str] | None = None) -> str:
    """Return the output of a process; CalledProcessError, with its error output printed, if it fails."""
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode and "egl" not in command:
        sys.stderr.write(done.stderr)
    done.check_returncode()
    return done.stdout


def last_line(text: str) -> Result:
    """Find the JSON object in output that engines print to, as well."""
    found: Result = json.loads([line for line in text.splitlines() if line.startswith("{")][-1])
    return found


def machine() -> str:
    """Describe the machine."""
    model = "a CPU"
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.partition(":")[2].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        model = names[0] if names else model
    return f"{len(os.sched_getaffinity(0))} cores of {model}, Python {platform.python_version()}"


if __name__ == "__main__":
    main()
