"""A drawing surface with world coordinates in metres (x right, y up), antialiased shapes and non-overlapping text."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont
from recipe_compiler.ir import exact
from recipe_compiler.ir.plan import Pose

Point = tuple[float, float]
Box = tuple[float, float, float, float]  # x0, y0, x1, y1
_OVERSAMPLING = 3
_INK = "#1d2126"


def placed(pose: Pose, points: Sequence[Point]) -> list[Point]:
    """Transform points from the frame of a pose to the world, metres."""
    s, c = exact.sin_cos_deg(pose.yaw)
    return [(pose.x + c * x - s * y, pose.y + s * x + c * y) for x, y in points]


def rectangle(pose: Pose, x0: float, x1: float, y0: float, y1: float) -> list[Point]:
    """Return the corners in the world of a rectangle in the frame of a pose."""
    return placed(pose, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


class Canvas:
    """Draws a part of the world, `box` in metres, at a number of pixels per metre."""

    def __init__(self, box: Box, scale: float, ground: str) -> None:
        self.box, self.scale = box, scale
        self.size = round((box[2] - box[0]) * scale), round((box[3] - box[1]) * scale)
        self._large = Image.new("RGB", (self.size[0] * _OVERSAMPLING, self.size[1] * _OVERSAMPLING), ground)
        self._pen = ImageDraw.Draw(self._large)
        self._texts: list[tuple[Point, str, str, int]] = []

    def pixel(self, point: Point) -> Point:
        """Return the pixel of a world point in the finished picture."""
        return (point[0] - self.box[0]) * self.scale, (self.box[3] - point[1]) * self.scale

    def _fine(self, points: Sequence[Point]) -> list[Point]:
        return [(x * _OVERSAMPLING, y * _OVERSAMPLING) for x, y in map(self.pixel, points)]

    def polygon(self, points: Sequence[Point], fill: str | None, line: str | None = None, width: float = 1.0) -> None:
        """Draw a filled polygon; `width` of its outline in pixels."""
        fine = self._fine(points)
        if fill:
            self._pen.polygon(fine, fill=fill)
        if line:
            self._pen.line([*fine, fine[0]], fill=line, width=round(width * _OVERSAMPLING), joint="curve")

    def line(self, points: Sequence[Point], colour: str, width: float = 1.0) -> None:
        """Draw a polyline, `width` in pixels."""
        self._pen.line(self._fine(points), fill=colour, width=max(1, round(width * _OVERSAMPLING)), joint="curve")

    def disc(self, centre: Point, radius: float, fill: str | None, line: str | None = None, width: float = 1.0) -> None:
        """Draw a circle, radius in metres."""
        (x, y), r = self._fine([centre])[0], radius * self.scale * _OVERSAMPLING
        outline_width = round(width * _OVERSAMPLING) if line else 0
        self._pen.ellipse((x - r, y - r, x + r, y + r), fill=fill, outline=line, width=outline_width)

    def arrow(self, pose: Pose, length: float, colour: str, width: float = 1.5) -> None:
        """Draw an arrow along a pose's x axis, centred on it, `length` in metres."""
        tail, tip, head = -length / 2, length / 2, 0.35 * length
        self.line(placed(pose, [(tail, 0.0), (tip - head / 2, 0.0)]), colour, width)
        self.polygon(placed(pose, [(tip, 0.0), (tip - head, head / 2), (tip - head, -head / 2)]), colour)

    def text(self, place: Point, words: str, colour: str = _INK, size: int = 15) -> None:
        """Draw text next to a world point, at the first position where it overlaps no other text."""
        self._texts.append((place, words, colour, size))

    def finished(self) -> Image.Image:
        """Return the finished picture."""
        picture = self._large.resize(self.size, Image.Resampling.BOX)
        pen, taken = ImageDraw.Draw(picture), list[Box]()
        for place, words, colour, size in self._texts:
            font = ImageFont.load_default(size)
            x0, y0, x1, y1 = pen.textbbox((0, 0), words, font=font)
            wide, high = x1 - x0, y1 - y0
            boxes = [self._beside(self.pixel(place), wide, high, n) for n in range(16)]
            box = next((b for b in boxes if not any(_overlap(b, other) for other in taken)), boxes[0])
            taken.append(box)
            pen.text((box[0] - x0, box[1] - y0), words, fill=colour, font=font, stroke_width=3, stroke_fill="#ffffff")
        return picture

    def _beside(self, at: Point, wide: float, high: float, n: int) -> Box:
        """Return the n-th candidate position of a text box next to a pixel, within the picture."""
        gap = 9 + 14 * (n // 4)
        x = at[0] + gap if n % 2 == 0 else at[0] - gap - wide
        y = at[1] - high / 2 + (n // 2 % 2 * 2 - 1) * (gap - 2)
        x, y = min(max(x, 4.0), self.size[0] - wide - 4), min(max(y, 4.0), self.size[1] - high - 4)
        return x, y, x + wide, y + high


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] + 4 and b[0] < a[2] + 4 and a[1] < b[3] + 4 and b[1] < a[3] + 4
