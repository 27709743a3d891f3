"""Reflections on wet ground: what a puddle mirrors is looked up in the picture itself.

The mirrored ray is followed until it passes behind something that the camera sees; that sample's light is reflected.
A ray that meets nothing sees the sky, or, if it is low, the street beyond the picture.
"""

# Kernels are Warp's language in Python's clothes; mypy cannot judge it.
# mypy: ignore-errors

from recipe_runtime.render.air import Air, reflected_sky
from recipe_runtime.render.device import OPTIONS, wp
from recipe_runtime.render.noise import clamp01, noise2, step_between
from recipe_runtime.render.shade import Samples
from recipe_runtime.render.vectors import direction, inner, mix
from recipe_runtime.render.visibility import Lens

wp.set_module_options(OPTIONS)

STEPS = wp.constant(13)
GROWTH = wp.constant(wp.float32(1.47))
FAINT = wp.constant(wp.float32(0.016))  # shares below this only see the sky


@wp.func
def seen_from(view: wp.array2d[wp.float32], v: wp.vec3f) -> wp.vec3f:
    """A direction of the world in the camera's frame."""
    return wp.vec3f(
        (view[0, 0] * v[0] + view[0, 1] * v[1]) + view[0, 2] * v[2],
        (view[0, 4] * v[0] + view[0, 5] * v[1]) + view[0, 6] * v[2],
        (view[0, 8] * v[0] + view[0, 9] * v[1]) + view[0, 10] * v[2],
    )


@wp.func
def pixel_at(q: wp.vec3f, lens: Lens) -> wp.int32:
    """The pixel that a point before the camera falls on; -1 outside of the picture."""
    scale = wp.float32(lens.focal) / q[2]
    x = q[0] * scale + wp.float32(lens.cx)
    y = q[1] * scale + wp.float32(lens.cy)
    if x < 0.0 or y < 0.0 or x >= wp.float32(lens.width) or y >= wp.float32(lens.height):
        return -1
    return wp.int32(y) * lens.width + wp.int32(x)


@wp.kernel
def reflect(
    samples: wp.array[Samples],
    air: wp.array[Air],
    gleam: wp.array[wp.vec2f],
    depth: wp.array[wp.float32],
    starts: wp.array[wp.int32],
    view: wp.array2d[wp.float32],
    lens: Lens,
    radiance: wp.array[wp.vec3f],
    out: wp.array[wp.vec3f],
):
    """Add to every sample what it mirrors."""
    i = wp.tid()
    light = radiance[i]
    share = gleam[i][0]
    if share <= 0.0:
        out[i] = light
        return
    p = samples[0].positions[i]
    to_point = p - samples[0].eye
    sight = direction(to_point)
    rough = 1.0 - gleam[i][1]
    # Ripples and grain turn the mirror a little, most of all along the sight, as on any wet road.
    ripple = (noise2(p[0] * 23.0, p[1] * 23.0, wp.uint32(31)) - 0.5) * (0.006 + 0.5 * rough)
    n = direction(wp.vec3f(sight[0] * ripple, sight[1] * ripple, 1.0))
    r = sight - n * (2.0 * inner(n, sight))
    d = direction(wp.vec3f(r[0], r[1], wp.max(r[2], 0.02)))
    hit = wp.int32(-1)
    if share > FAINT:
        start = seen_from(view, to_point)
        way = seen_from(view, d)
        before = wp.float32(0.05)
        t = wp.float32(0.2)
        for _step in range(STEPS):
            q = start + way * t
            if q[2] <= 0.2:
                break
            at = pixel_at(q, lens)
            if at < 0:
                break
            seen = depth[at]
            if seen < q[2] - 0.03 and seen > q[2] - 0.3 - 1.3 * (t - before):
                hit = at
                break
            before = t
            t = t * GROWTH
        if hit >= 0:
            # Close in on where the ray first passed behind it.
            low = before
            high = t
            for _halving in range(4):
                middle = (low + high) * 0.5
                q = start + way * middle
                at = pixel_at(q, lens)
                behind = False
                if at >= 0:
                    behind = depth[at] < q[2] - 0.03
                if behind:
                    hit = at
                    high = middle
                else:
                    low = middle
    seen_light = reflected_sky(air, d)
    if hit >= 0:
        seen_light = radiance[starts[hit]]
    else:
        street = step_between(0.34, 0.12, d[2])
        seen_light = mix(seen_light, air[0].sideways * 0.45, clamp01(street))
    out[i] = light + seen_light * share
