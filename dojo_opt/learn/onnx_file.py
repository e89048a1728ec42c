"""ONNX files of policies, for controllers that run no Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dojo_opt.learn.network import Network
from solvers.types import Floats

__all__ = ["write_onnx"]

_OPSET, _IR = 13, 8  # of 2020, which all runtimes of today read
_SPAN = 10.0  # as in policy.py


def write_onnx(network: Network, weights: Floats, scale: tuple[Floats, Floats], path: str | Path) -> None:
    """The graph clip((o - mean) / deviation), Gemm and activation by layer, tanh or clip at the end.

    scale: mean and deviation (no,)
    """
    try:
        import onnx
        from onnx import TensorProto, helper, numpy_helper
    except ImportError:
        raise ImportError('LearnedPolicy.export_onnx needs onnx: pip install "dojo-opt[onnx]"') from None
    constants: list[Any] = []
    nodes: list[Any] = []

    def constant(name: str, value: Any) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value, dtype=np.float32), name))
        return name

    def node(kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    y = node("Sub", ["observation", constant("mean", scale[0])], "centred")
    y = node("Div", [y, constant("deviation", scale[1])], "scaled")
    y = node("Clip", [y, constant("least", -_SPAN), constant("most", _SPAN)], "limited")
    layers = network.layers(weights)
    for k, (W, b) in enumerate(layers):
        y = node("Gemm", [y, constant(f"W{k}", W), constant(f"b{k}", b)], f"y{k}")
        if k < len(layers) - 1:
            y = node("Tanh" if network.activation == "tanh" else "Elu", [y], f"f{k}")
    if len(layers) == 1:
        node("Clip", [y, constant("low", -1.0), constant("high", 1.0)], "action")
    else:
        node("Tanh", [y], "action")
    sizes = network.sizes
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", size])
        for name, size in (("observation", sizes[0]), ("action", sizes[-1]))
    ]
    graph = helper.make_graph(nodes, "policy", ends[:1], ends[1:], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))
