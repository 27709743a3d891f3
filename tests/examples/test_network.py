"""The downloaded detectors have the outputs of TensorFlow Lite and TensorFlow.js, and detect a rendered person.

`make test-detector`.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.detector
torch = pytest.importorskip("torch")

RECIPE = """
recipe: person
seed: 5
base:
  clock: {fps: 10, frames: 5}
  town: {name: downtown, blocks: [1, 1]}
  actors: {hero: {blueprint: walker.pedestrian.0004, speed: 1.2, start: {x: -6, y: 0}, goal: {x: -6, y: 10}}}
  sensors:
    street:
      mount: {x: -5.6, y: -4.5, z: 1.5, yaw: 90, pitch: -2}
      camera: {width: 300, height: 300, fov: 45}
      capture: [rgb]
"""


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Any:
    import recipe_runtime

    path: Path = tmp_path_factory.mktemp("person") / "person.yaml"
    path.write_text(RECIPE)
    return np.asarray(recipe_runtime.open(path).render(4), np.float32) / 255


def test_outputs_equal_those_of_tensorflow_lite(picture: Any) -> None:
    litert = pytest.importorskip("ai_edge_litert.interpreter")
    from examples.attacks.detector_file import OBJECTRON, detector_files
    from examples.attacks.network import TfliteNetwork

    (model,) = detector_files(OBJECTRON)
    interpreter = litert.Interpreter(model_content=model)
    interpreter.allocate_tensors()
    interpreter.set_tensor(interpreter.get_input_details()[0]["index"], picture[None] * 2 - 1)
    interpreter.invoke()
    expected = {tuple(row["shape"]): interpreter.get_tensor(row["index"]) for row in interpreter.get_output_details()}
    with torch.no_grad():
        outputs = TfliteNetwork(model)(torch.tensor(picture[None] * 2 - 1))
    assert {tuple(values.shape) for values in outputs} == set(expected)
    for values in outputs:
        np.testing.assert_allclose(values.numpy(), expected[tuple(values.shape)], atol=1e-3)


def test_outputs_equal_those_of_tensorflow_js(picture: Any, tmp_path: Path) -> None:
    """So do the detections, which the graph computes from them."""
    if "NODE_PATH" not in os.environ:
        pytest.skip("NODE_PATH names no folder with @tensorflow/tfjs; `make test-detector` installs it")
    from examples.attacks.centernet import OUTPUTS, SIDE, CenterNet
    from examples.attacks.detector import resized
    from examples.attacks.detector_file import HUMAN, detector_files
    from examples.attacks.tfjs import TfjsNetwork

    graph, weights = detector_files(HUMAN)
    shown = resized(torch.tensor(picture.transpose(2, 0, 1)[None]), SIDE)
    pixels = shown.permute(0, 2, 3, 1) * 255
    files = {"graph": graph, "weights": weights, "picture": pixels.numpy().astype("<f4").tobytes()}
    for name, body in files.items():
        (tmp_path / name).write_bytes(body)
    script = Path(__file__).with_name("run_tfjs.cjs")
    paths = [str(tmp_path / name) for name in files]
    nodes = [*OUTPUTS, "tower_0/detections"]
    command = ["node", str(script), *paths, str(SIDE), str(tmp_path / "out"), *nodes]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    *expected, peaks = (np.fromfile(tmp_path / f"out.{k}", "<f4") for k in range(3))
    network = TfjsNetwork(graph, weights, OUTPUTS)
    with torch.no_grad():
        outputs = network(pixels)
        (found,) = CenterNet(network).eval()([shown[0]])
    for values, wanted in zip(outputs, expected, strict=True):
        np.testing.assert_allclose(values.numpy().ravel(), wanted, atol=5e-3)
    rows = peaks.reshape(100, 6)[:3]  # the best are not neighbours, which non-maximum suppression removes
    assert found["labels"][:3].tolist() == rows[:, 5].astype(int).tolist()
    np.testing.assert_allclose(found["boxes"][:3].numpy(), rows[:, :4], atol=5e-3)
    np.testing.assert_allclose(found["scores"][:3].numpy(), rows[:, 4], atol=1e-5)


@pytest.mark.parametrize(("name", "score"), [("SSD", 0.4), ("CenterNet", 0.6)])
def test_a_rendered_person_is_found(name: str, score: float, picture: Any) -> None:
    from examples.attacks.detectors import opened

    detector = opened(name)
    with torch.no_grad():
        (found,) = detector([torch.tensor(picture.transpose(2, 0, 1))])
    people = found["labels"] == detector.person
    assert float(found["scores"][people].max()) > score
    x0, y0, x1, y1 = found["boxes"][people][0].tolist()
    assert 90 < (x0 + x1) / 2 < 150 and y1 - y0 > 2 * (x1 - x0)
