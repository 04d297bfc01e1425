"""Procedural textures with detail from decimetres down to a few millimetres.

A texture function takes (shape, texel, colors, rng): rows and columns, metres a texel, display colours (sRGB,
0-1) and a generator; it returns (rows, columns, 3) float32 in display values. Row 0 is the top. Patterns do
not repeat exactly: a repeated motif matches itself and is no help to structure from motion.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from room2dgs.demo_room.geometry import Material

Shape = tuple[int, int]


def texture(material: Material, size: tuple[float, float], texel: float, rng: np.random.Generator) -> np.ndarray:
    """(rows, columns, 3) uint8 sRGB picture of a patch of `size` metres (u, v) at `texel` metres a texel."""
    shape = (max(2, round(size[1] / texel)), max(2, round(size[0] / texel)))
    image = TEXTURES[material.kind](shape, texel, np.asarray(material.colors, np.float32), rng)
    return np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)


def noise(rng: np.random.Generator, shape: Shape, texel: float, along_v: float, along_u: float) -> np.ndarray:
    """Smooth noise, (rows, columns) float32 of about unit deviation, with wavelengths in metres."""
    rows = max(2, round(shape[0] * texel / along_v) + 1)
    columns = max(2, round(shape[1] * texel / along_u) + 1)
    lattice = rng.standard_normal((rows, columns), dtype=np.float32)
    return 1.4 * cv2.resize(lattice, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)


def octaves(
    rng: np.random.Generator,
    shape: Shape,
    texel: float,
    coarse: float,
    fine: float = 0.008,
    gain: float = 0.8,
) -> np.ndarray:
    """Noise of wavelengths coarse, coarse/2, ... fine (metres), amplitudes falling by `gain`; deviation 1."""
    total = np.zeros(shape, np.float32)
    amplitude, power, wavelength = 1.0, 0.0, coarse
    while wavelength >= max(fine, 2 * texel) or power == 0.0:
        total += np.float32(amplitude) * noise(rng, shape, texel, wavelength, wavelength)
        power += amplitude**2
        amplitude *= gain
        wavelength /= 2
    return total / np.float32(np.sqrt(power))


def mixed(first, second, weight: np.ndarray) -> np.ndarray:
    """first + (second - first) * weight, the weight clipped to [0, 1]."""
    weight = np.clip(weight, 0, 1)[..., None].astype(np.float32)
    return np.asarray(first, np.float32) * (1 - weight) + np.asarray(second, np.float32) * weight


def shaded(image: np.ndarray, tone: np.ndarray) -> np.ndarray:
    """The image multiplied by 1 + tone."""
    return image * (1 + tone)[..., None].astype(np.float32)


def metres(shape: Shape, texel: float) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (u to the right, v down) of the texel centres in metres, broadcastable float32."""
    u = (np.arange(shape[1], dtype=np.float32)[None] + 0.5) * texel
    v = (np.arange(shape[0], dtype=np.float32)[:, None] + 0.5) * texel
    return u, v


def canvas(shape: Shape, color) -> np.ndarray:
    """A picture of one colour to draw on with cv2."""
    return np.ascontiguousarray(np.broadcast_to(np.asarray(color, np.float32), (*shape, 3)))


def paint(shape, texel, colors, rng):
    """Uniform paint: nothing to match."""
    return canvas(shape, colors[0])


def cracked(shape, texel, colors, rng):
    """Concrete: strong mottling, cracks and paint splashes."""
    image = mixed(colors[0], colors[1], 0.5 + 0.32 * octaves(rng, shape, texel, 0.6, gain=0.9))
    veins = np.abs(octaves(rng, shape, texel, 0.35, gain=0.55))
    return shaded(image, -0.35 * np.exp(-((veins / 0.035) ** 2)))


def bricks(shape, texel, colors, rng):
    """Courses of bricks, each with a tone of its own."""
    u, v = metres(shape, texel)
    length, height, joint = 0.22, 0.072, 0.011
    row = np.floor(v / height).astype(int)
    shifted = u + 0.5 * length * (row % 2) + 0.03 * rng.random(row.max() + 1, np.float32)[row]
    column = np.floor(shifted / length).astype(int)
    tones = rng.random((row.max() + 1, column.max() + 1)).astype(np.float32)[np.broadcast_to(row, shape), column]
    wobble = 0.0025 * octaves(rng, shape, texel, 0.05)
    border = np.minimum(
        np.minimum(v % height, height - v % height), np.minimum(shifted % length, length - shifted % length)
    )
    face = mixed(colors[0], colors[1], tones + 0.18 * octaves(rng, shape, texel, 0.06, gain=0.9))
    face = shaded(face, 0.13 * octaves(rng, shape, texel, 0.03, 0.006))
    mortar = shaded(canvas(shape, colors[2]), 0.10 * octaves(rng, shape, texel, 0.04, 0.006))
    return mixed(mortar, face, (border + wobble - joint / 2) / 0.004 + 0.5)


def grain(shape, texel, colors, rng):
    """Wood with the grain along the longer side."""
    if shape[0] > shape[1]:
        return grain(shape[::-1], texel, colors, rng).transpose(1, 0, 2)
    bands = 0.55 * noise(rng, shape, texel, 0.05, 0.7) + 0.5 * noise(rng, shape, texel, 0.02, 0.35)
    bands += 0.45 * noise(rng, shape, texel, 0.008, 0.12)
    rings = np.sin(2 * np.pi * (bands * 1.1 + noise(rng, shape, texel, 0.3, 0.8)))
    image = mixed(colors[0], colors[1], 0.5 + 0.22 * rings + 0.20 * bands)
    pores = noise(rng, shape, texel, 0.005, 0.03) > 1.7
    return shaded(image, 0.07 * octaves(rng, shape, texel, 0.2) - 0.25 * pores)


def planks(shape, texel, colors, rng):
    """A wooden floor: staggered planks with grain, joints and knots."""
    u, v = metres(shape, texel)
    width, length = 0.125, 0.95
    row = np.floor(v / width).astype(int)
    shifted = u + length * rng.random(row.max() + 1).astype(np.float32)[row]
    column = np.floor(shifted / length).astype(int)
    tones = rng.random((row.max() + 1, column.max() + 1)).astype(np.float32)[np.broadcast_to(row, shape), column]
    fibre = 0.6 * noise(rng, shape, texel, 0.03, 0.5) + 0.6 * noise(rng, shape, texel, 0.011, 0.14)
    rings = np.sin(2 * np.pi * (0.8 * fibre + 1.5 * tones + noise(rng, shape, texel, 0.09, 0.5)))
    image = mixed(colors[0], colors[1], tones * 0.7 + 0.15 + 0.14 * rings + 0.16 * fibre)
    image = shaded(image, 0.10 * octaves(rng, shape, texel, 0.15))
    for _ in range(int(2.5 * shape[0] * shape[1] * texel**2)):
        centre = (int(rng.integers(shape[1])), int(rng.integers(shape[0])))
        axes = (
            max(1, int(rng.uniform(0.008, 0.022) / texel)),
            max(1, int(rng.uniform(0.005, 0.012) / texel)),
        )
        cv2.ellipse(image, centre, axes, 0, 0, 360, (0.45 * colors[0]).tolist(), -1, cv2.LINE_AA)
    border = np.minimum(
        np.minimum(v % width, width - v % width), np.minimum(shifted % length, length - shifted % length)
    )
    return shaded(image, -0.6 * np.clip((0.004 - border) / 0.002, 0, 1))


def flowers(shape, texel, colors, rng):
    """Wallpaper with scattered flowers and stems, no two alike."""
    image = shaded(canvas(shape, colors[0]), 0.06 * octaves(rng, shape, texel, 0.4, gain=0.9))
    for _ in range(int(55 * shape[0] * shape[1] * texel**2) + 1):
        x, y = rng.random() * shape[1], rng.random() * shape[0]
        radius, turn = rng.uniform(0.015, 0.05) / texel, rng.uniform(0, 360)
        petals, color = int(rng.integers(4, 8)), colors[rng.integers(1, len(colors))] * rng.uniform(0.8, 1.15)
        stem = (int(x + rng.normal() * 2.5 * radius), int(y + 3 * radius))
        cv2.line(
            image,
            (int(x), int(y)),
            stem,
            (0.7 * colors[-1]).tolist(),
            max(1, int(0.006 / texel)),
            cv2.LINE_AA,
        )
        for petal in range(petals):
            angle = turn + 360 * petal / petals
            offset = 0.62 * radius * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
            centre = (int(x + offset[0]), int(y + offset[1]))
            axes = (max(1, int(0.5 * radius)), max(1, int(0.28 * radius)))
            cv2.ellipse(image, centre, axes, angle, 0, 360, color.tolist(), -1, cv2.LINE_AA)
        cv2.circle(image, (int(x), int(y)), max(1, int(0.25 * radius)), (0.45 * color).tolist(), -1, cv2.LINE_AA)
    return shaded(image, 0.05 * octaves(rng, shape, texel, 0.05))


def stripes(shape, texel, colors, rng):
    """Vertical stripes of uneven width with woven noise and small sprigs."""
    u, _ = metres(shape, texel)
    edges = np.cumsum(rng.uniform(0.03, 0.11, 2 + int(shape[1] * texel / 0.03)))
    band = np.searchsorted(edges, u[0] + 0.0)
    tone = 0.35 * rng.standard_normal(len(edges) + 1).astype(np.float32)[band] + (band % 2)
    image = mixed(colors[0], colors[1], np.broadcast_to(tone, shape) + 0.12 * octaves(rng, shape, texel, 0.08))
    sprigs = octaves(rng, shape, texel, 0.06, 0.01, gain=0.7)
    return shaded(image, -0.28 * np.clip((sprigs - 1.1) / 0.3, 0, 1) + 0.05 * octaves(rng, shape, texel, 0.5))


def ceiling(shape, texel, colors, rng):
    """A light ceiling: rough-cast with joints of the boards."""
    u, v = metres(shape, texel)
    image = shaded(canvas(shape, colors[0]), 0.075 * octaves(rng, shape, texel, 0.3, gain=0.95))
    border = np.minimum(u % 1.2, v % 0.6)
    return shaded(image, -0.25 * np.clip((0.008 - border) / 0.004, 0, 1))


def plaid(shape, texel, colors, rng):
    """Woven cloth: crossing bands of uneven width and thread noise."""
    image = canvas(shape, colors[0])
    for axis in (0, 1):
        count = shape[axis]
        edges = np.cumsum(rng.uniform(0.012, 0.07, 2 + int(count * texel / 0.012))) / texel
        band = np.searchsorted(edges, np.arange(count) + 0.5)
        pick = rng.integers(0, len(colors), len(edges) + 1)[band]
        weave = colors[pick]
        image = 0.5 * image + 0.5 * (weave[:, None] if axis == 0 else weave[None])
    threads = noise(rng, shape, texel, 0.004, 0.03) + noise(rng, shape, texel, 0.03, 0.004)
    return shaded(image, 0.05 * threads + 0.08 * octaves(rng, shape, texel, 0.08))


def cloth(shape, texel, colors, rng):
    """Upholstery: mottled with small motifs."""
    image = mixed(colors[0], colors[1], 0.45 + 0.25 * octaves(rng, shape, texel, 0.12, gain=0.95))
    motif = octaves(rng, shape, texel, 0.04, 0.012, gain=0.6)
    return mixed(image, colors[-1], np.clip((motif - 1.2) / 0.2, 0, 1) * 0.8)


def rug(shape, texel, colors, rng):
    """A carpet: nested borders and a field of diamonds, all a little irregular."""
    u, v = metres(shape, texel)
    width, height = shape[1] * texel, shape[0] * texel
    bend = 0.006 * octaves(rng, shape, texel, 0.12)
    inset = np.minimum(np.minimum(u, width - u), np.minimum(v, height - v)) + bend
    rings = np.abs(u - width / 2) / width + np.abs(v - height / 2) / height
    period = np.searchsorted(np.cumsum(rng.uniform(0.015, 0.06, 60)), np.maximum(rings + 0.3 * bend, 0))
    image = colors[rng.integers(0, len(colors), 61)[period]]
    lattice = (np.floor((u + v + bend) / 0.07) * 7 + np.floor((u - v - bend) / 0.07) * 13).astype(int) % 97
    image = mixed(image, colors[rng.integers(0, len(colors), 97)[lattice]], np.full(shape, 0.45, np.float32))
    edge = np.searchsorted(np.array([0.02, 0.05, 0.06, 0.13, 0.14, 0.17]), inset)
    border = colors[np.array([0, 1, 2, 3, 2, 0, 1]) % len(colors)][edge]
    image = np.where((edge < 6)[..., None], border, image)
    return shaded(image, 0.13 * octaves(rng, shape, texel, 0.06) + 0.05 * noise(rng, shape, texel, 0.006, 0.006))


def speckle(shape, texel, colors, rng):
    """Terrazzo: chips of several colours in a ground."""
    image = shaded(canvas(shape, colors[0]), 0.06 * octaves(rng, shape, texel, 0.15))
    for _ in range(int(1500 * shape[0] * shape[1] * texel**2) + 2):
        centre = (int(rng.integers(shape[1])), int(rng.integers(shape[0])))
        axes = tuple(max(1, int(x / texel)) for x in rng.uniform(0.003, 0.013, 2))
        color = (colors[rng.integers(1, len(colors))] * rng.uniform(0.7, 1.2)).tolist()
        cv2.ellipse(image, centre, axes, rng.uniform(0, 180), 0, 360, color, -1, cv2.LINE_AA)
    return image


def painting(shape, texel, colors, rng):
    """An abstract painting: washes, shapes and strokes."""
    height, width = shape
    image = mixed(colors[0], colors[1], 0.5 + 0.5 * noise(rng, shape, texel, 0.3, 0.3))
    scale = min(shape)
    for _ in range(26):
        color = (colors[rng.integers(len(colors))] * rng.uniform(0.6, 1.3)).tolist()
        centre = rng.random(2) * (width, height)
        if rng.random() < 0.5:
            corners = (centre + rng.normal(size=(int(rng.integers(3, 6)), 2)) * scale * 0.14).astype(np.int32)
            cv2.fillPoly(image, [corners], color, cv2.LINE_AA)
        else:
            axes = tuple(max(1, int(x)) for x in rng.uniform(0.02, 0.14, 2) * scale)
            cv2.ellipse(image, centre.astype(int).tolist(), axes, rng.uniform(0, 180), 0, 360, color, -1, cv2.LINE_AA)
    for _ in range(30):
        color = (colors[rng.integers(len(colors))] * rng.uniform(0.3, 1.3)).tolist()
        start = rng.random(2) * (width, height)
        end = (start + rng.normal(size=2) * scale * 0.25).astype(int).tolist()
        thickness = max(1, int(rng.uniform(0.003, 0.01) / texel))
        cv2.line(image, start.astype(int).tolist(), end, color, thickness, cv2.LINE_AA)
    return shaded(image, 0.09 * octaves(rng, shape, texel, 0.06))


LETTERS = np.array(list("ABDEFGHKLMNPRSTUXYZ0123456789&%#"))


def write_words(image, texel, start, end_x, letter_height, color, rng):
    """One line of random words from the pixel `start` (x, y of the baseline) to the column `end_x`."""
    scale = letter_height / texel / 22
    thickness = max(1, round(0.16 * letter_height / texel))
    count = max(1, int((end_x - start[0]) / (18 * scale)))
    words = "".join(rng.choice(LETTERS, count))
    ink = np.zeros(image.shape[:2], np.uint8)  # OpenCV 5 writes on 8-bit pictures only
    cv2.putText(ink, words, start, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, thickness, cv2.LINE_AA)
    image[:] = mixed(image, color, ink / np.float32(255))


def poster(shape, texel, colors, rng):
    """A printed page: a headline, a picture and lines of text."""
    height, width = shape
    image = shaded(canvas(shape, colors[0]), 0.03 * octaves(rng, shape, texel, 0.1))
    margin, y = int(0.07 * width), int(0.05 * height)
    ink = 0.25 * colors[1]
    headline = 0.11 * height * texel
    y += int(headline / texel)
    write_words(image, texel, (margin, y), width - margin, headline, ink, rng)
    top, bottom = y + int(0.04 * height), y + int(0.38 * height)
    if bottom - top > 4 and width > 4 * margin + 4:
        picture = (bottom - top, width - 2 * margin)
        image[top:bottom, margin : width - margin] = painting(picture, texel, colors[1:], rng)
    y = bottom
    while True:
        size = rng.choice([0.016, 0.022, 0.03]) * max(1.0, height * texel)
        y += int(1.7 * size / texel) + 1
        if y > height - margin:
            return image
        write_words(image, texel, (margin, y), int(rng.uniform(0.6, 0.95) * width), size, ink, rng)


def spine(shape, texel, colors, rng):
    """A book: coloured bands and a title along the longer side."""
    if shape[0] > shape[1]:
        return spine(shape[::-1], texel, colors, rng)[:, ::-1].transpose(1, 0, 2)
    height, width = shape
    image = shaded(canvas(shape, colors[0]), 0.07 * octaves(rng, shape, texel, 0.05))
    for edge in rng.uniform(0.03, 0.97, 3):
        start = int(edge * width)
        image[:, start : start + max(1, int(0.008 / texel))] = colors[1]
    baseline = int(0.7 * height)
    write_words(image, texel, (int(0.12 * width), baseline), int(0.85 * width), 0.5 * height * texel, colors[1], rng)
    return image


def pages(shape, texel, colors, rng):
    """The cut side of a book or a stack of paper."""
    return shaded(canvas(shape, colors[0]), 0.10 * noise(rng, shape, texel, 0.004, 0.2))


def cardboard(shape, texel, colors, rng):
    """A cardboard box: brown, taped, printed."""
    image = shaded(canvas(shape, colors[0]), 0.08 * octaves(rng, shape, texel, 0.2))
    middle, half = shape[0] // 2, max(1, int(0.025 / texel))
    image[max(0, middle - half) : middle + half] *= 1.25
    for _ in range(3):
        size = rng.uniform(0.02, 0.05)
        x, y = int(rng.uniform(0.05, 0.5) * shape[1]), int(rng.uniform(0.15, 0.95) * shape[0])
        write_words(image, texel, (x, y), int(0.9 * shape[1]), size, 0.3 * colors[0], rng)
    return image


def enamel(shape, texel, colors, rng):
    """Painted metal or plastic with wear."""
    image = shaded(canvas(shape, colors[0]), 0.05 * octaves(rng, shape, texel, 0.1))
    scratches = octaves(rng, shape, texel, 0.03)
    return mixed(image, colors[-1], np.clip((scratches - 1.7) / 0.2, 0, 1) * 0.7)


def white(shape, texel, colors, rng):
    """A light's own face; its brightness is in the baked light."""
    return canvas(shape, (1.0, 1.0, 1.0))


Texture = Callable[[Shape, float, np.ndarray, np.random.Generator], np.ndarray]
TEXTURES: dict[str, Texture] = {
    "bricks": bricks,
    "cardboard": cardboard,
    "ceiling": ceiling,
    "cloth": cloth,
    "cracked": cracked,
    "emitter": white,
    "enamel": enamel,
    "flowers": flowers,
    "grain": grain,
    "pages": pages,
    "paint": paint,
    "painting": painting,
    "plaid": plaid,
    "planks": planks,
    "poster": poster,
    "rug": rug,
    "speckle": speckle,
    "spine": spine,
    "stripes": stripes,
}
