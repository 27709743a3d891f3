"""A network of TensorFlow Lite as a PyTorch module, through which gradients flow.

It knows the operators that SSD-MobileNet consists of. Tensors have TensorFlow's layout, [n, height, width, channels].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import tflite
import torch
from torch.nn import functional

_NUMBERS = {tflite.TensorType.FLOAT32: "<f4", tflite.TensorType.FLOAT16: "<f2", tflite.TensorType.INT32: "<i4"}


class TfliteNetwork(torch.nn.Module):
    """The graph of a model, with its weights as float32 buffers.

    Args:
        model: The bytes of a .tflite file.

    Raises:
        ValueError: The graph has an operator that this module does not know.
    """

    def __init__(self, model: bytes) -> None:
        super().__init__()
        parsed = tflite.Model.GetRootAs(model, 0)
        graph = parsed.Subgraphs(0)
        constants = _constants(parsed, graph)
        self._input, self._outputs = int(graph.Inputs(0)), [int(k) for k in graph.OutputsAsNumpy()]
        self._wires: list[tuple[list[int], int]] = []
        self._layers = torch.nn.ModuleList()
        for operator in (graph.Operators(k) for k in range(graph.OperatorsLength())):
            inputs, output = [int(k) for k in operator.InputsAsNumpy()], int(operator.Outputs(0))
            code = parsed.OperatorCodes(operator.OpcodeIndex())
            kind = max(code.BuiltinCode(), code.DeprecatedBuiltinCode())  # the older field ends at 127
            if kind == tflite.BuiltinOperator.DEQUANTIZE and inputs[0] in constants:
                constants[output] = constants[inputs[0]]
                continue
            weights = [constants[k] for k in inputs if k in constants]
            self._wires.append(([k for k in inputs if k not in constants], output))
            self._layers.append(_layer(kind, operator.BuiltinOptions(), weights))

    def forward(self, pictures: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return the outputs of the graph, in its order, for its one input [n, height, width, channels]."""
        values = {self._input: pictures}
        for (inputs, output), layer in zip(self._wires, self._layers, strict=True):
            values[output] = layer(*[values[k] for k in inputs])
        return tuple(values[k] for k in self._outputs)


class Convolution(torch.nn.Module):
    """A convolution with TensorFlow's padding "same", and its activation.

    Args:
        kernel: [out, height, width, in], or of a depthwise convolution [1, height, width, channels].
        bias: [out].
        stride: In both directions.
        depthwise: Whether each channel is filtered by itself.
        limit: Values are clipped to 0 to this: 6 for ReLU6, infinity for ReLU. None: they are not.
    """

    _kernel: torch.Tensor
    _bias: torch.Tensor

    def __init__(
        self, kernel: torch.Tensor, bias: torch.Tensor, stride: int, depthwise: bool, limit: float | None
    ) -> None:
        super().__init__()
        self.register_buffer("_kernel", kernel.permute((3, 0, 1, 2) if depthwise else (0, 3, 1, 2)).contiguous())
        self.register_buffer("_bias", bias)
        self._stride, self._groups, self._limit = stride, len(bias) if depthwise else 1, limit

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Return the filtered values [n, height, width, out] of values [n, height, width, in]."""
        columns = _same_padding(values.shape[2], self._kernel.shape[3], self._stride)
        rows = _same_padding(values.shape[1], self._kernel.shape[2], self._stride)
        padded = functional.pad(values.permute(0, 3, 1, 2), (*columns, *rows))
        found = functional.conv2d(padded, self._kernel, self._bias, self._stride, groups=self._groups)
        return (found if self._limit is None else found.clamp(0, self._limit)).permute(0, 2, 3, 1)


class _Addition(torch.nn.Module):
    def forward(self, one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
        return one + other


class _Reshape(torch.nn.Module):
    def __init__(self, shape: Sequence[int]) -> None:
        super().__init__()
        self._shape = tuple(shape[1:])  # the graph is for one picture

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        return values.reshape(len(values), *self._shape)


class _Concatenation(torch.nn.Module):
    def forward(self, *values: torch.Tensor) -> torch.Tensor:
        return torch.cat(values, dim=1)


def _layer(kind: int, options: Any, constants: list[torch.Tensor]) -> torch.nn.Module:
    operators = tflite.BuiltinOperator
    if kind in (operators.CONV_2D, operators.DEPTHWISE_CONV_2D):
        depthwise = kind == operators.DEPTHWISE_CONV_2D
        read = tflite.DepthwiseConv2DOptions() if depthwise else tflite.Conv2DOptions()
        read.Init(options.Bytes, options.Pos)
        clipped = read.FusedActivationFunction() == tflite.ActivationFunctionType.RELU6
        return Convolution(constants[0], constants[1], read.StrideH(), depthwise, 6 if clipped else None)
    if kind == operators.ADD:
        return _Addition()
    if kind == operators.RESHAPE:
        return _Reshape(constants[0].tolist())
    if kind == operators.CONCATENATION:
        return _Concatenation()
    raise ValueError(f"operator {kind} of TensorFlow Lite is not supported")


def _constants(parsed: Any, graph: Any) -> dict[int, torch.Tensor]:
    """Return the tensors that have values in the file, by their index."""
    constants = {}
    for index in range(graph.TensorsLength()):
        tensor = graph.Tensors(index)
        buffer = parsed.Buffers(tensor.Buffer())
        if buffer.DataLength():
            values = np.frombuffer(buffer.DataAsNumpy().tobytes(), _NUMBERS[tensor.Type()])
            values = values.reshape(tensor.ShapeAsNumpy() if tensor.ShapeLength() else ())
            constants[index] = torch.tensor(values.astype(np.int64 if values.dtype.kind == "i" else np.float32))
    return constants


def _same_padding(size: int, kernel: int, stride: int) -> tuple[int, int]:
    """Return how many zeros stand before and after `size` values, as TensorFlow pads."""
    total = max((-(-size // stride) - 1) * stride + kernel - size, 0)
    return total // 2, total - total // 2
