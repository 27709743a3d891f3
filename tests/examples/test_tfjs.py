"""TensorFlow.js' operators in PyTorch, compared with sums written out. `make test-torch`."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest

pytestmark = pytest.mark.torch
torch = pytest.importorskip("torch")

Node = dict[str, Any]


def text(value: str) -> dict[str, str]:
    return {"s": base64.b64encode(value.encode()).decode()}


def convolution(kind: str, stride: int, fused: list[str], padding: str = "SAME") -> Node:
    steps = {"list": {"i": ["1", str(stride), str(stride), "1"]}}
    after = {"list": {"s": [text(name)["s"] for name in fused]}}
    return {"op": kind, "attr": {"strides": steps, "padding": text(padding), "fused_ops": after}}


def network(nodes: dict[str, Node], constants: dict[str, Any], dtype: str = "float32") -> Any:
    """Return the network of nodes, whose last one is its output, with weights stored as `dtype`."""
    from examples.attacks.tfjs import TfjsNetwork

    graph = [{"name": "picture", "op": "Placeholder"}, *({"name": name, "op": "Const"} for name in constants)]
    graph += [{"name": name, **node} for name, node in nodes.items()]
    specs, body = [], b""
    for name, value in constants.items():
        integer = value.dtype.kind == "i"
        spec = {"name": name, "shape": list(value.shape), "dtype": "int32" if integer else "float32"}
        specs.append(spec if integer or dtype == "float32" else spec | {"quantization": {"dtype": dtype}})
        body += value.astype("<i4" if integer else {"float32": "<f4", "float16": "<f2"}[dtype]).tobytes()
    model = {"modelTopology": {"node": graph[::-1]}, "weightsManifest": [{"weights": specs}]}
    return TfjsNetwork(json.dumps(model).encode(), body, [list(nodes)[-1]])


def values(*shape: int, seed: int = 1) -> Any:
    return np.random.default_rng(seed).integers(-8, 9, shape).astype(np.float32) / 4


def filtered(picture: Any, kernel: Any, stride: int, depthwise: bool) -> Any:
    """Return a convolution with padding "same", one output at a time."""
    size, side = kernel.shape[0], -(-picture.shape[1] // stride)
    total = max((side - 1) * stride + size - picture.shape[1], 0)
    padded = np.pad(picture, ((0, 0), *[(total // 2, total - total // 2)] * 2, (0, 0)))
    found = np.zeros((len(picture), side, side, kernel.shape[2 if depthwise else 3]), np.float32)
    for y in range(side):
        for x in range(side):
            window = padded[:, y * stride : y * stride + size, x * stride : x * stride + size]
            product = window[..., None] * kernel if not depthwise else window * kernel[..., 0]
            found[:, y, x] = product.sum(axis=(1, 2) if depthwise else (1, 2, 3))
    return found


@pytest.mark.parametrize("stride", [1, 2])
@pytest.mark.parametrize("depthwise", [False, True])
@pytest.mark.parametrize("fused", [[], ["BiasAdd"], ["BiasAdd", "Relu"]])
def test_convolutions_pad_as_tensorflow_does(stride: int, depthwise: bool, fused: list[str]) -> None:
    picture, kernel, bias = values(2, 7, 7, 3), values(3, 3, 3, 1 if depthwise else 5), values(3 if depthwise else 5)
    kind = "FusedDepthwiseConv2dNative" if depthwise else "_FusedConv2D"
    node = convolution(kind, stride, fused) | {"input": ["picture", "kernel", "bias"]}
    (found,) = network({"out": node}, {"kernel": kernel, "bias": bias})(torch.tensor(picture))
    expected = filtered(picture, kernel, stride, depthwise) + (bias if fused else 0)
    np.testing.assert_array_equal(found.numpy(), np.maximum(expected, 0) if "Relu" in fused else expected)


def test_pictures_are_enlarged_from_their_corner() -> None:
    """[0, 4] becomes [0, 2, 4, 4]: without half-pixel centres, the last pixel is repeated."""
    nodes = {"out": {"op": "ResizeBilinear", "input": ["picture", "size"]}}
    model = network(nodes, {"size": np.array([2, 4], np.int32)})
    (found,) = model(torch.tensor([[[[0.0], [4.0]], [[8.0], [16.0]]]]))
    assert found[0, ..., 0].tolist() == [[0, 2, 4, 4], [8, 12, 16, 16]]
    (rows,) = network(nodes, {"size": np.array([4, 2], np.int32)})(torch.tensor([[[[0.0], [4.0]], [[8.0], [16.0]]]]))
    assert rows[0, ..., 0].tolist() == [[0, 4], [4, 10], [8, 16], [8, 16]]


def test_the_other_operators() -> None:
    """Hard swish and squeeze-and-excite, as MobileNetV3 has them."""
    constants = {
        "three": np.array(3, np.float32),
        "sixth": np.array(0.25, np.float32),
        "hw": np.array([1, 2], np.int32),
        "last": np.array(3, np.int32),
    }
    nodes = {
        "add": {"op": "Add", "input": ["picture", "three"]},
        "relu6": {"op": "Relu6", "input": ["add"]},
        "scaled": {"op": "Mul", "input": ["relu6", "sixth"]},
        "swish": {"op": "Mul", "input": ["picture", "scaled"]},
        "mean": {"op": "Mean", "input": ["swish", "hw"]},
        "gate": {"op": "Sigmoid", "input": ["mean"]},
        "gated": {"op": "Mul", "input": ["swish", "gate"]},
        "relu": {"op": "Relu", "input": ["gated"]},
        "both": {"op": "ConcatV2", "input": ["relu", "swish", "last"]},
        "out": {"op": "Identity", "input": ["both"]},
    }
    picture = values(2, 4, 4, 3) * 4
    swish = picture * np.clip(picture + 3, 0, 6) * 0.25
    gated = np.maximum(swish / (1 + np.exp(-swish.mean(axis=(1, 2), keepdims=True))), 0)
    (found,) = network(nodes, constants, "float16")(torch.tensor(picture))
    np.testing.assert_allclose(found.numpy(), np.concatenate([gated, swish], axis=3), atol=1e-6)


def test_gradients_reach_the_picture() -> None:
    node = convolution("Conv2D", 2, []) | {"input": ["picture", "kernel"]}
    model, picture = network({"out": node}, {"kernel": values(3, 3, 2, 2)}), torch.tensor(values(1, 5, 5, 2))
    picture.requires_grad_()
    assert torch.autograd.gradcheck(model.double(), (picture.double().detach().requires_grad_(),))


def test_what_is_not_known_is_refused() -> None:
    with pytest.raises(ValueError, match="out: operator Softmax of TensorFlow"):
        network({"out": {"op": "Softmax", "input": ["picture"]}}, {})
    node = convolution("Conv2D", 1, [], "VALID") | {"input": ["picture", "kernel"]}
    with pytest.raises(ValueError, match="this form of Conv2D"):
        network({"out": node}, {"kernel": values(3, 3, 2, 2)})
    with pytest.raises(ValueError, match="this form of _FusedConv2D"):
        network(
            {"out": convolution("_FusedConv2D", 1, ["Elu"]) | {"input": ["picture", "kernel"]}},
            {"kernel": values(3, 3, 2, 2)},
        )
