"""The downloaded detector has the outputs of TensorFlow Lite, and detects a rendered person. `make test-detector`."""

from __future__ import annotations

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
def model() -> bytes:
    from examples.attacks.detector_file import detector_file

    return detector_file()


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Any:
    import recipe_runtime

    path: Path = tmp_path_factory.mktemp("person") / "person.yaml"
    path.write_text(RECIPE)
    return np.asarray(recipe_runtime.open(path).render(4), np.float32) / 255


def test_outputs_equal_those_of_tensorflow_lite(model: bytes, picture: Any) -> None:
    litert = pytest.importorskip("ai_edge_litert.interpreter")
    from examples.attacks.network import TfliteNetwork

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


def test_a_rendered_person_is_found(model: bytes, picture: Any) -> None:
    from examples.attacks.network import TfliteNetwork
    from examples.attacks.ssd import PERSON, PhotographDetector

    detector = PhotographDetector(TfliteNetwork(model)).eval()
    with torch.no_grad():
        (found,) = detector([torch.tensor(picture.transpose(2, 0, 1))])
    people = found["labels"] == PERSON
    assert float(found["scores"][people].max()) > 0.4
    x0, y0, x1, y1 = found["boxes"][people][0].tolist()
    assert 90 < (x0 + x1) / 2 < 150 and y1 - y0 > 2 * (x1 - x0)
