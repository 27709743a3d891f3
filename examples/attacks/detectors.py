"""The detectors of the studies, by name."""

from __future__ import annotations

from collections.abc import Callable

from examples.attacks.centernet import OUTPUTS, CenterNet
from examples.attacks.detector import Detector
from examples.attacks.detector_file import HUMAN, OBJECTRON, detector_files
from examples.attacks.network import TfliteNetwork
from examples.attacks.ssd import Ssd
from examples.attacks.tfjs import TfjsNetwork


def opened(name: str) -> Detector:
    """Return a detector of `DETECTORS` in evaluation mode; its files are fetched on the first call."""
    found = DETECTORS[name]()
    found.eval()
    return found


def _ssd() -> Detector:
    return Ssd(TfliteNetwork(*detector_files(OBJECTRON)))


def _centernet() -> Detector:
    graph, weights = detector_files(HUMAN)
    return CenterNet(TfjsNetwork(graph, weights, OUTPUTS))


DETECTORS: dict[str, Callable[[], Detector]] = {"SSD": _ssd, "CenterNet": _centernet}
