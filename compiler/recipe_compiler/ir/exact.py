"""Elementary functions that give the same bits on every machine.

libm's `sin`, `exp` and similar functions differ in the last bit between CPUs with and without FMA, so no number in a
plan or a kernel may come from them. These functions use only IEEE-754 `+ - * /` and `sqrt`, which the standard rounds
correctly, in a fixed order. Accuracy is within a few ulp over the stated ranges.
"""

import math

_DEGREE = math.pi / 180.0
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10


def distance(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance of two points of the plane."""
    return math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))


def _sin_small(x: float) -> float:
    """Sine of x radians, |x| <= pi/4, by its Taylor series (error below 1e-17)."""
    z = x * x
    tail = z / 272.0
    tail = (1.0 - tail) * z / 210.0
    tail = (1.0 - tail) * z / 156.0
    tail = (1.0 - tail) * z / 110.0
    tail = (1.0 - tail) * z / 72.0
    tail = (1.0 - tail) * z / 42.0
    tail = (1.0 - tail) * z / 20.0
    tail = (1.0 - tail) * z / 6.0
    return x * (1.0 - tail)


def _cos_small(x: float) -> float:
    """Cosine of x radians, |x| <= pi/4, by its Taylor series (error below 1e-17)."""
    z = x * x
    tail = z / 306.0
    tail = (1.0 - tail) * z / 240.0
    tail = (1.0 - tail) * z / 182.0
    tail = (1.0 - tail) * z / 132.0
    tail = (1.0 - tail) * z / 90.0
    tail = (1.0 - tail) * z / 56.0
    tail = (1.0 - tail) * z / 30.0
    tail = (1.0 - tail) * z / 12.0
    tail = (1.0 - tail) * z / 2.0
    return 1.0 - tail


def sin_cos_deg(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle in degrees; exact at multiples of 90."""
    turned = math.fmod(angle, 360.0)
    quarter = math.floor(turned / 90.0 + 0.5)
    rest = (turned - 90.0 * quarter) * _DEGREE
    s, c = _sin_small(rest), _cos_small(rest)
    return ((s, c), (c, -s), (-s, -c), (-c, s))[int(quarter) % 4]


def sin_deg(angle: float) -> float:
    """Sine of an angle in degrees."""
    return sin_cos_deg(angle)[0]


def cos_deg(angle: float) -> float:
    """Cosine of an angle in degrees."""
    return sin_cos_deg(angle)[1]


def _atan_unit(x: float) -> float:
    """Arc tangent of x in [0, 1], in radians: two half-angle steps, then the series."""
    for _ in range(2):
        x = x / (1.0 + math.sqrt(1.0 + x * x))
    z = x * x
    total = 0.0
    for n in range(27, 0, -2):
        total = 1.0 / n - z * total
    return 4.0 * x * total


def atan2_deg(y: float, x: float) -> float:
    """Angle of the vector (x, y) in degrees, in (-180, 180]; 0 for the null vector."""
    if x == 0.0 and y == 0.0:
        return 0.0
    ax, ay = abs(x), abs(y)
    angle = _atan_unit(ay / ax) / _DEGREE if ay <= ax else 90.0 - _atan_unit(ax / ay) / _DEGREE
    if x < 0.0:
        angle = 180.0 - angle
    return -angle if y < 0.0 else angle


def exp(x: float) -> float:
    """e to the x, for |x| < 700."""
    k = math.floor(x / 0.6931471805599453 + 0.5)
    r = (x - k * _LN2_HIGH) - k * _LN2_LOW
    total = 1.0
    for n in range(20, 0, -1):
        total = 1.0 + r * total / n
    return math.ldexp(total, k)


def log(x: float) -> float:
    """Natural logarithm of x > 0."""
    if x <= 0.0:
        raise ValueError(f"log of {x!r}, which is not positive")
    mantissa, exponent = math.frexp(x)
    if mantissa < 0.7071067811865476:
        mantissa, exponent = mantissa * 2.0, exponent - 1
    t = (mantissa - 1.0) / (mantissa + 1.0)
    z = t * t
    total = 0.0
    for n in range(41, 0, -2):
        total = 1.0 / n + z * total
    return exponent * _LN2_HIGH + (2.0 * t * total + exponent * _LN2_LOW)


def power(base: float, exponent: float) -> float:
    """`base ** exponent` for base >= 0."""
    if base == 0.0:
        return 1.0 if exponent == 0.0 else 0.0
    return exp(exponent * log(base))
