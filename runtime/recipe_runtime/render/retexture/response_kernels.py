"""Kernels from the radiance of samples to the values of pixels, with derivatives and their transposes, in float64.

They do not round, except where a comment says so, and every sum has a fixed order: a CPU and a GPU give equal bytes.
N slots number the samples of Q pixels.
"""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp

wp.set_module_options(OPTIONS)

_ZERO = wp.constant(wp.float64(0.0))
_ONE = wp.constant(wp.float64(1.0))
# Narkowicz's fit to the ACES curve, x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), its derivative and its inverse.
_A = wp.constant(wp.float64(2.51))
_B = wp.constant(wp.float64(0.03))
_C = wp.constant(wp.float64(2.43))
_D = wp.constant(wp.float64(0.59))
_E = wp.constant(wp.float64(0.14))
_2A = wp.constant(wp.float64(5.02))
_2C = wp.constant(wp.float64(4.86))
_4E = wp.constant(wp.float64(0.56))
_2E = wp.constant(wp.float64(0.28))
_TWO = wp.constant(wp.float64(2.0))
_TINY = wp.constant(wp.float64(1e-12))
# Noise of light x has the deviation 0.0005 + 0.008 sqrt(x).
_DARK = wp.constant(wp.float64(0.0005))
_SHOT = wp.constant(wp.float64(0.008))
_HALF_SHOT = wp.constant(wp.float64(0.004))
_LEAST_ROOT = wp.constant(wp.float64(1e-3))


@wp.struct
class MirrorArrays:
    """Slots of wet ground that reflect a patch or are patched, M, and by slot those that reflect it."""

    slots: wp.array[wp.int32]  # [M]
    shares: wp.array[wp.float64]  # [M] weight of the reflection
    sources: wp.array[wp.int32]  # [M] slot whose radiance is reflected; -1: `limits` is the reflected radiance
    limits: wp.array[wp.vec3d]  # [M] maximum of the reflected radiance
    firsts: wp.array[wp.int32]  # [N + 1] first entry of each slot in `numbers`
    numbers: wp.array[wp.int32]  # mirrors that reflect a slot, ascending


@wp.struct
class SlotLight:
    """How the radiance of slots becomes the light of pixels."""

    mirrored: wp.array[wp.vec3d]  # [N] reflections that do not depend on the texture
    factors: wp.array[wp.vec3d]  # [N] of exposure, white balance and rain
    rain: wp.array[wp.vec3d]  # [N] exposed light of streaks
    weights: wp.array[wp.float64]  # [N] in the pixel
    pixels: wp.array[wp.int32]  # [N] pixel of each slot
    firsts: wp.array[wp.int32]  # [Q] first slot of each pixel
    counts: wp.array[wp.int32]  # [Q]


@wp.func
def tone(light: wp.float64) -> wp.vec2d:
    """Return tone-mapped light, 0 to 1, and its derivative."""
    x = wp.max(light, _ZERO)
    numerator = x * (_A * x + _B)
    denominator = x * (_C * x + _D) + _E
    y = numerator / denominator
    slope = ((_2A * x + _B) * denominator - numerator * (_2C * x + _D)) / (denominator * denominator)
    if y >= _ONE or x <= _ZERO:
        slope = _ZERO
    return wp.vec2d(wp.min(y, _ONE), slope)


@wp.func
def inverse_tone(y: wp.float64) -> wp.vec2d:
    """Return the light that `tone` maps to y, and its derivative."""
    a = _A - _C * y
    b = _B - _D * y
    root = wp.sqrt(b * b + _4E * a * y)
    x = (root - b) / (_TWO * a)
    half = (-_D * b + _2E * (_A - _2C * y)) / wp.max(root, _TINY)
    return wp.vec2d(x, (half + _D + _2C * x) / (_TWO * a))


@wp.kernel
def light_slots(
    samples: wp.array[wp.int32],
    gain: wp.array[wp.vec3d],
    texels: wp.array[wp.vec3d],
    out_radiance: wp.array[wp.vec3d],
):
    """Write the light of a patch on the slots that it covers; `texels` is the patch's linear colour at each."""
    k = wp.tid()
    slot = samples[k]
    g = gain[slot]
    t = texels[k]
    out_radiance[slot] = wp.vec3d(g[0] * t[0], g[1] * t[1], g[2] * t[2])


@wp.kernel
def texel_gradients(
    samples: wp.array[wp.int32],
    gain: wp.array[wp.vec3d],
    gradient: wp.array[wp.vec3d],
    out_texels: wp.array[wp.vec3d],
):
    """Write the transpose of `light_slots`."""
    k = wp.tid()
    g = gain[samples[k]]
    y = gradient[samples[k]]
    out_texels[k] = wp.vec3d(y[0] * g[0], y[1] * g[1], y[2] * g[2])


@wp.kernel
def reflect_slots(
    mirrors: wp.array[MirrorArrays],
    radiance: wp.array[wp.vec3d],
    out_shown: wp.array[wp.vec3d],
    out_passed: wp.array[wp.vec3d],
):
    """Add reflections in wet ground to the light of slots, and write 1 where the reflected radiance is below its limit.

    Slots of mirrors differ from each other.
    """
    k = wp.tid()
    source = mirrors[0].sources[k]
    limit = mirrors[0].limits[k]
    slot = mirrors[0].slots[k]
    share = mirrors[0].shares[k]
    light = limit
    if source >= 0:
        light = radiance[source]
    shown = out_shown[slot]
    passed = wp.vec3d(_ONE, _ONE, _ONE)
    for c in range(3):
        if source < 0 or light[c] > limit[c]:
            passed[c] = _ZERO
        shown[c] = shown[c] + wp.min(light[c], limit[c]) * share
    out_shown[slot] = shown
    out_passed[k] = passed


@wp.kernel
def tone_pixels(
    light: wp.array[SlotLight],
    shown: wp.array[wp.vec3d],
    out_level: wp.array[wp.vec3d],
    out_slope: wp.array[wp.vec3d],
):
    """Write the tone-mapped light of each pixel, the weighted sum over its slots, and its derivative by slot."""
    q = wp.tid()
    first = light[0].firsts[q]
    total = wp.vec3d(_ZERO, _ZERO, _ZERO)
    for slot in range(first, first + light[0].counts[q]):
        weight = light[0].weights[slot]
        factor = light[0].factors[slot]
        rain = light[0].rain[slot]
        slope = wp.vec3d(_ZERO, _ZERO, _ZERO)
        for c in range(3):
            toned = tone(shown[slot][c] * factor[c] + rain[c])
            total[c] = total[c] + toned[0] * weight
            slope[c] = toned[1] * weight * factor[c]
        out_slope[slot] = slope
    out_level[q] = total


@wp.kernel
def slot_gradients(
    light: wp.array[SlotLight],
    gradient: wp.array[wp.vec3d],
    slope: wp.array[wp.vec3d],
    out_shown: wp.array[wp.vec3d],
):
    """Write the gradient of the light of slots, of one of the pixels."""
    slot = wp.tid()
    y = gradient[light[0].pixels[slot]]
    s = slope[slot]
    out_shown[slot] = wp.vec3d(y[0] * s[0], y[1] * s[1], y[2] * s[2])


@wp.kernel
def mirror_gradients(
    mirrors: wp.array[MirrorArrays],
    shown: wp.array[wp.vec3d],
    passed: wp.array[wp.vec3d],
    out_radiance: wp.array[wp.vec3d],
):
    """Write the gradient of the radiance of slots, of one of their light: their own, and that of their reflections."""
    slot = wp.tid()
    added = wp.vec3d(_ZERO, _ZERO, _ZERO)
    for e in range(mirrors[0].firsts[slot], mirrors[0].firsts[slot + 1]):
        k = mirrors[0].numbers[e]
        y = shown[mirrors[0].slots[k]]
        share = mirrors[0].shares[k]
        for c in range(3):
            added[c] = added[c] + y[c] * passed[k][c] * share
    out_radiance[slot] = shown[slot] + added


@wp.kernel
def undo_tone(level: wp.array[wp.vec3d], out_light: wp.array[wp.vec3d], out_slope: wp.array[wp.vec3d]):
    """Write the light of the HDR image, and its derivative."""
    k = wp.tid()
    light = wp.vec3d(_ZERO, _ZERO, _ZERO)
    slope = wp.vec3d(_ZERO, _ZERO, _ZERO)
    for c in range(3):
        found = inverse_tone(level[k][c])
        light[c] = found[0]
        slope[c] = found[1]
    out_light[k] = light
    out_slope[k] = slope


@wp.kernel
def select_channels(
    red: wp.array[wp.vec3d], green: wp.array[wp.vec3d], blue: wp.array[wp.vec3d], out_colour: wp.array[wp.vec3d]
):
    """Write the first channel of the first array, the second of the second, and the third of the third."""
    k = wp.tid()
    out_colour[k] = wp.vec3d(red[k][0], green[k][1], blue[k][2])


@wp.kernel
def tone_samples(
    light: wp.array[wp.vec3d],
    change: wp.array[wp.vec3d],
    gain: wp.array[wp.float64],
    per_pixel: wp.int32,
    out_level: wp.array[wp.vec3d],
    out_slope: wp.array[wp.vec3d],
):
    """Write the mean of the tone-mapped samples of each pixel behind a lens, and its derivative by sample."""
    q = wp.tid()
    total = wp.vec3d(_ZERO, _ZERO, _ZERO)
    n = wp.float64(per_pixel)
    for k in range(q * per_pixel, (q + 1) * per_pixel):
        slope = wp.vec3d(_ZERO, _ZERO, _ZERO)
        for c in range(3):
            toned = tone((light[k][c] + change[k][c]) * gain[k])
            total[c] = total[c] + toned[0]
            slope[c] = toned[1] * gain[k] / n
        out_slope[k] = slope
    out_level[q] = total / n


@wp.kernel
def sample_gradients(
    gradient: wp.array[wp.vec3d], slope: wp.array[wp.vec3d], per_pixel: wp.int32, out_samples: wp.array[wp.vec3d]
):
    """Write the gradient of the light of samples behind a lens, of one of the pixels."""
    k = wp.tid()
    y = gradient[k / per_pixel]
    out_samples[k] = wp.vec3d(y[0] * slope[k][0], y[1] * slope[k][1], y[2] * slope[k][2])


@wp.kernel
def encode_pixels(
    level: wp.array[wp.vec3d],
    deviates: wp.array[wp.vec3d],
    noise: wp.float64,
    table: wp.array[wp.float64],
    out_noisy: wp.array[wp.vec3d],
    out_values: wp.array[wp.vec3d],
    out_slope: wp.array[wp.vec3d],
):
    """Write light with noise, the picture's value of it, 0 to 1, and the value's derivative by the light.

    `table` has the values of equally spaced light from 0 to 1, between which values are interpolated linearly.
    """
    q = wp.tid()
    last = table.shape[0] - 1
    top = wp.float64(last)
    noisy = wp.vec3d(_ZERO, _ZERO, _ZERO)
    values = wp.vec3d(_ZERO, _ZERO, _ZERO)
    slope = wp.vec3d(_ZERO, _ZERO, _ZERO)
    for c in range(3):
        light = level[q][c]
        grain = noise * deviates[q][c]
        root = wp.sqrt(wp.max(light, _ZERO))
        grainy = light + grain * (_DARK + _SHOT * root)
        noise_slope = _ONE + grain * _HALF_SHOT / wp.max(root, _LEAST_ROOT)
        t = wp.min(wp.max(grainy, _ZERO), _ONE) * top
        i = wp.min(wp.int32(t), last - 1)
        step = table[i + 1] - table[i]
        noisy[c] = grainy
        values[c] = table[i] + step * (t - wp.float64(i))
        if grainy >= _ZERO and grainy <= _ONE:
            slope[c] = step * top * noise_slope
    out_noisy[q] = noisy
    out_values[q] = values
    out_slope[q] = slope
