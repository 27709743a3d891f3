"""Kernels use the renderer's vector functions where Warp has functions of the same name."""

from __future__ import annotations

from typing import no_type_check

import numpy as np
from recipe_runtime.render.device.launch import launch
from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.noise import floor, smoothstep
from recipe_runtime.render.numeric.vectors import cross, dot, normalize

wp.set_module_options(OPTIONS)


@no_type_check  # written in Warp's language
@wp.kernel
def _evaluate(a: wp.vec3f, b: wp.vec3f, x: wp.float32, out: wp.array[wp.float32]):
    n = normalize(wp.vec3f(0.0, 0.0, 0.0))
    c = cross(a, b)
    out[0] = n[2]
    out[1] = dot(a, b)
    out[2] = c[0]
    out[3] = wp.float32(floor(x))
    out[4] = smoothstep(0.0, 4.0, x)


def test_kernels_call_the_renderers_own_vector_functions() -> None:
    """The renderer normalises a null vector to "up" (Warp: to null) and keeps a fixed order of additions."""
    a, b = np.array([[0.1, 3.3e7, -0.7], [1.7, 1.1, 5.1e7]], np.float32)
    out = wp.zeros(5, dtype=wp.float32, device="cpu")
    u, v = (wp.vec3f(*map(float, vector)) for vector in (a, b))
    launch(_evaluate, 1, "cpu", a=u, b=v, x=-1.5, out=out)
    expected = [np.float32(1), (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2], a[1] * b[2] - a[2] * b[1], -2, 0]
    np.testing.assert_array_equal(out.numpy(), np.array(expected, np.float32))
