"""The detectors of the studies, by name, and the device on which they run."""

from __future__ import annotations

from collections.abc import Callable

import torch

from examples.attacks.centernet import OUTPUTS, CenterNet
from examples.attacks.detector import Detector
from examples.attacks.detector_file import HUMAN, OBJECTRON, detector_files
from examples.attacks.network import TfliteNetwork
from examples.attacks.ssd import Ssd
from examples.attacks.tfjs import TfjsNetwork

_device = "cpu"


def use_one_thread(device: str = "cpu") -> None:
    """Let this process compute on one thread, and run the detectors that it opens from now on on a device."""
    global _device
    torch.set_num_threads(1)
    torch.backends.cudnn.allow_tf32 = False
    _device = device


def opened(name: str) -> Detector:
    """Return a detector of `DETECTORS` in evaluation mode; its files are fetched on the first call."""
    found = DETECTORS[name]()
    found.eval()
    return found if _device == "cpu" else Elsewhere(found, _device).eval()


class Elsewhere(Detector):
    """A detector that runs on another device than its pictures.

    Args:
        detector: The detector.
        device: The device, such as `cuda`.
    """

    def __init__(self, detector: Detector, device: str) -> None:
        super().__init__()
        self._device, self._detector, self.person = device, detector.to(device), detector.person

    def raw(self, pictures: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """As `Detector.raw`, on the device of the pictures."""
        with torch.device(self._device):  # also of the tensors that the detector creates
            boxes, logits = self._detector.raw(pictures.to(self._device))
        return boxes.to(pictures.device), logits.to(pictures.device)

    def scores(self, logits: torch.Tensor) -> torch.Tensor:
        """As `Detector.scores`."""
        return self._detector.scores(logits)


def _ssd() -> Detector:
    return Ssd(TfliteNetwork(*detector_files(OBJECTRON)))


def _centernet() -> Detector:
    graph, weights = detector_files(HUMAN)
    return CenterNet(TfjsNetwork(graph, weights, OUTPUTS))


DETECTORS: dict[str, Callable[[], Detector]] = {"SSD": _ssd, "CenterNet": _centernet}
