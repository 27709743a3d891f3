"""The studies of docs/attack-goals.md: hiding a person, hiding a car, and misleading a tracker.

    python -m examples.attacks.goals --output datasets/attack-goals

Requires `torch` and `tflite`. Finished attacks are kept in the folder; another run does what is missing. All seeds are
fixed; PyTorch's convolutions may differ between CPUs in their last digits.
"""

from __future__ import annotations

import argparse
import resource
from pathlib import Path

from benchmarks.pages import markdown, write_table
from examples.attacks.goals import car, hiding, parts, tracking

COMMAND = "make attack-goals"
STUDIES = {study.name: study for study in (hiding.STUDY, car.STUDY, tracking.STUDY)}


def main(arguments: list[str] | None = None) -> None:
    """Run the studies, and write and print their tables and pictures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--output", type=Path, default=Path("datasets/attack-goals"), help="folder of finished attacks")
    parser.add_argument("--only", nargs="+", choices=list(STUDIES), default=list(STUDIES), help="some of the studies")
    parser.add_argument("--again", action="store_true", help="report what this folder has, and run nothing")
    parser.add_argument("--page", type=Path, help="page to write the tables into; the pictures lie beside it")
    parser.add_argument("--seeds", type=int, default=3, help="attacks of each kind")
    parser.add_argument("--steps", type=int, help="steps of an attack, in place of the study's")
    parser.add_argument("--workers", type=int, default=2, help="processes, of one thread each")
    parser.add_argument("--device", default="cpu", help="device of the detectors, such as cuda")
    options = parser.parse_args(arguments)
    studies = [STUDIES[name] for name in options.only]
    if not options.again:
        kept = {"seeds": options.seeds, "steps": options.steps}
        parts.run(studies, options.output, **kept, workers=options.workers, device=options.device)
    for study in studies:
        found = parts.read(study, options.output, seeds=options.seeds)
        for name, table in study.tables(found).items():
            print(f"\n{name}\n\n{markdown(table)}", flush=True)
            if options.page:
                write_table(options.page, f"{COMMAND}: {name}", table)
        folder = options.page.parent if options.page else options.output
        study.draw(found, folder / f"attack-goals-{study.name}.jpg")
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(f"\n{sum(use.ru_utime + use.ru_stime for use in used) / 60:.1f} minutes of processor time")


if __name__ == "__main__":
    main()
