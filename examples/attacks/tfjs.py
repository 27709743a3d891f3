"""A network of TensorFlow.js (a graph model) as a PyTorch module, through which gradients flow.

It knows the operators that CenterNet with MobileNetV3 consists of. Tensors have TensorFlow's layout,
[n, height, width, channels].
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from torch.nn import functional

from examples.attacks.network import Convolution

_STORED = {"float16": "<f2", "float32": "<f4", "int32": "<i4"}
_SAME = "SAME"


class TfjsNetwork(torch.nn.Module):
    """The part of a graph on which some of its nodes depend, with its weights as float32 buffers.

    Args:
        graph: The bytes of the model's .json file.
        weights: The bytes of its one .bin file.
        outputs: Names of the nodes whose values are wanted.

    Raises:
        ValueError: The graph has an operator that this module does not know.
    """

    def __init__(self, graph: bytes, weights: bytes, outputs: Sequence[str]) -> None:
        super().__init__()
        model = json.loads(graph)
        nodes = {node["name"]: node for node in model["modelTopology"]["node"]}
        constants = _constants(model["weightsManifest"], weights)
        self._outputs, self._wires = tuple(outputs), []
        self._layers = torch.nn.ModuleList()
        for name in _ordered(nodes, outputs):
            node = nodes[name]
            if node["op"] == "Placeholder":
                self._input = name
            elif node["op"] != "Const":
                inputs = node["input"]
                self._wires.append(([key for key in inputs if key not in constants], name))
                self._layers.append(_layer(node, [constants[key] for key in inputs if key in constants]))

    def forward(self, pictures: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return the values of the wanted nodes for the graph's one input [n, height, width, channels]."""
        values = {self._input: pictures}
        for (inputs, name), layer in zip(self._wires, self._layers, strict=True):
            values[name] = layer(*[values[key] for key in inputs])
        return tuple(values[name] for name in self._outputs)


class _Pointwise(torch.nn.Module):
    """A function of two tensors, of which the second may be a constant."""

    _constant: torch.Tensor | None

    def __init__(self, function: Callable[..., torch.Tensor], constants: Sequence[torch.Tensor]) -> None:
        super().__init__()
        self._function = function
        self.register_buffer("_constant", constants[0] if constants else None)

    def forward(self, *values: torch.Tensor) -> torch.Tensor:
        return self._function(*values) if self._constant is None else self._function(*values, self._constant)


class _Function(torch.nn.Module):
    """A function of one tensor or several."""

    def __init__(self, function: Callable[..., torch.Tensor]) -> None:
        super().__init__()
        self._function = function

    def forward(self, *values: torch.Tensor) -> torch.Tensor:
        return self._function(*values)


def _layer(node: dict[str, Any], constants: list[torch.Tensor]) -> torch.nn.Module:
    kind, attributes = node["op"], node.get("attr", {})
    if kind in ("Conv2D", "_FusedConv2D", "DepthwiseConv2dNative", "FusedDepthwiseConv2dNative"):
        return _convolution(node["name"], kind, attributes, constants)
    if kind in ("Mul", "Add"):
        return _Pointwise(torch.mul if kind == "Mul" else torch.add, constants)
    if kind == "Mean":
        dimensions = tuple(constants[0].tolist())
        return _Function(lambda values: values.mean(dim=dimensions, keepdim=True))
    if kind == "ConcatV2":
        dimension = int(constants[0])
        return _Function(lambda *values: torch.cat(values, dim=dimension))
    if kind == "ResizeBilinear":
        height, width = constants[0].tolist()
        return _Function(lambda values: _resized(values, height, width))
    simple = {"Relu": torch.relu, "Relu6": functional.relu6, "Sigmoid": torch.sigmoid, "Identity": torch.clone}
    if kind in simple:
        return _Function(simple[kind])
    raise ValueError(f"{node['name']}: operator {kind} of TensorFlow.js is not supported")


def _convolution(name: str, kind: str, attributes: dict[str, Any], constants: list[torch.Tensor]) -> Convolution:
    kernel, depthwise = constants[0], "Depthwise" in kind  # [height, width, in, out] or [.., channels, multiplier]
    after = [base64.b64decode(text).decode() for text in attributes.get("fused_ops", {"list": {"s": []}})["list"]["s"]]
    padding = base64.b64decode(attributes["padding"]["s"]).decode()
    strides = {int(value) for value in attributes["strides"]["list"]["i"][1:3]}
    known = set(after) <= {"BiasAdd", "Relu"} and (padding == _SAME or kernel.shape[:2] == (1, 1))
    if not known or len(strides) != 1 or (depthwise and kernel.shape[3] != 1):
        raise ValueError(f"{name}: this form of {kind} is not supported")
    kernel = kernel.permute(3, 0, 1, 2).contiguous()
    count = kernel.shape[3] if depthwise else kernel.shape[0]
    bias = constants[1] if "BiasAdd" in after else torch.zeros(count)
    limit = math.inf if "Relu" in after else None
    return Convolution(kernel, bias, strides.pop(), depthwise, limit)


def _resized(values: torch.Tensor, height: int, width: int) -> torch.Tensor:
    """Return values [n, h, w, c] in another size, by bilinear interpolation whose corner pixels share a corner.

    A pixel (x, y) takes its value from the place (x * w / width, y * h / height), as TensorFlow does without
    `half_pixel_centers`.
    """
    for dimension, size in ((1, height), (2, width)):
        last = values.shape[dimension] - 1
        places = torch.arange(size, dtype=torch.float32) * (values.shape[dimension] / size)
        low = places.floor().long()
        part = (places - low).reshape([-1 if k == dimension else 1 for k in range(4)])
        first, second = (values.index_select(dimension, (low + k).clamp(max=last)) for k in (0, 1))
        values = first + (second - first) * part
    return values


def _ordered(nodes: dict[str, Any], outputs: Sequence[str]) -> list[str]:
    """Return the names of the nodes on which outputs depend, each after its inputs."""
    done: dict[str, None] = {}
    waiting = list(outputs)
    while waiting:
        missing = [key for key in nodes[waiting[-1]].get("input", []) if key not in done]
        if missing:
            waiting += missing
        else:
            done[waiting.pop()] = None
    return list(done)


def _constants(manifest: list[dict[str, Any]], weights: bytes) -> dict[str, torch.Tensor]:
    constants, position = {}, 0
    for entry in (entry for group in manifest for entry in group["weights"]):
        stored = np.dtype(_STORED[entry.get("quantization", entry)["dtype"]])
        values = np.frombuffer(weights, stored, math.prod(entry["shape"]), position).reshape(entry["shape"])
        position += values.nbytes
        constants[entry["name"]] = torch.tensor(values.astype(np.int64 if stored.kind == "i" else np.float32))
    if position != len(weights):
        raise ValueError(f"the weights have {len(weights)} bytes, not {position}")
    return constants
