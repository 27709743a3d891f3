"""Stateless noise: an integer hash of a key, and smooth noise over a lattice of hashes."""

# Kernels are written in Warp's subset of Python, whose types mypy does not model.
# mypy: ignore-errors

from recipe_runtime.render.device.setup import OPTIONS, wp
from recipe_runtime.render.numeric.scalars import clamp01, maximum, minimum

wp.set_module_options(OPTIONS)

_A = wp.constant(wp.uint32(0x7FEB352D))
_B = wp.constant(wp.uint32(0x846CA68B))
_X = wp.constant(wp.uint32(0x8DA6B343))
_Y = wp.constant(wp.uint32(0xD8163841))
_Z = wp.constant(wp.uint32(0xCB1AB31F))
INV_2_24 = wp.constant(wp.float32(1.0 / 16777216.0))


@wp.func
def scramble(h: wp.uint32) -> wp.uint32:
    """Return a 32-bit hash in which every input bit affects every output bit (Wellons, lowbias32)."""
    h = h ^ (h >> wp.uint32(16))
    h = h * _A
    h = h ^ (h >> wp.uint32(15))
    h = h * _B
    return h ^ (h >> wp.uint32(16))


@wp.func
def hash2(x: wp.int32, y: wp.int32, seed: wp.uint32) -> wp.uint32:
    """A hash of a lattice point of the plane."""
    return scramble(wp.uint32(x) * _X ^ wp.uint32(y) * _Y ^ seed)


@wp.func
def hash3(x: wp.int32, y: wp.int32, z: wp.int32, seed: wp.uint32) -> wp.uint32:
    """A hash of a lattice point of space."""
    return scramble(wp.uint32(x) * _X ^ wp.uint32(y) * _Y ^ wp.uint32(z) * _Z ^ seed)


@wp.func
def unit(h: wp.uint32) -> wp.float32:
    """Map a hash to a number in [0, 1)."""
    return wp.float32(h >> wp.uint32(8)) * INV_2_24


@wp.func
def floor(x: wp.float32) -> wp.int32:
    """Return the floor of x, clamped to the range of lattice coordinates."""
    c = maximum(minimum(x, wp.float32(1.0e9)), wp.float32(-1.0e9))
    i = wp.int32(c)
    if wp.float32(i) > c:
        i = i - 1
    return i


@wp.func
def ease(t: wp.float32) -> wp.float32:
    """Return the cubic smoothstep of t in [0, 1]."""
    return t * t * (3.0 - 2.0 * t)


@wp.func
def smoothstep(low: wp.float32, high: wp.float32, x: wp.float32) -> wp.float32:
    """Return 0 below low, 1 above high, and a cubic between."""
    return ease(clamp01((x - low) / (high - low)))


@wp.func
def lattice(h: wp.uint32) -> wp.float32:
    """Map the key of a lattice point to [0, 1), by a cheaper hash than `scramble`, sufficient for smooth noise."""
    h = (h ^ (h >> wp.uint32(15))) * _A
    h = (h ^ (h >> wp.uint32(13))) * _B
    return unit(h)


@wp.func
def noise2(x: wp.float32, y: wp.float32, seed: wp.uint32) -> wp.float32:
    """Smooth noise in [0, 1) with features one unit wide."""
    i = floor(x)
    j = floor(y)
    fx = ease(x - wp.float32(i))
    fy = ease(y - wp.float32(j))
    left = wp.uint32(i) * _X
    low_row = wp.uint32(j) * _Y ^ seed
    high_row = wp.uint32(j + 1) * _Y ^ seed
    a = lattice(left ^ low_row)
    b = lattice((left + _X) ^ low_row)
    c = lattice(left ^ high_row)
    d = lattice((left + _X) ^ high_row)
    low = a + (b - a) * fx
    high = c + (d - c) * fx
    return low + (high - low) * fy


@wp.func
def noise3(x: wp.float32, y: wp.float32, z: wp.float32, seed: wp.uint32) -> wp.float32:
    """Smooth noise in space, in [0, 1), with features one unit wide."""
    k = floor(z)
    fz = ease(z - wp.float32(k))
    low = noise2(x, y, scramble(wp.uint32(k) ^ seed))
    high = noise2(x, y, scramble(wp.uint32(k + 1) ^ seed))
    return low + (high - low) * fz
