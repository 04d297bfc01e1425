"""USDZ: the textured mesh for iPhones, iPads and programs that read USD.

The package is a zip whose files are stored as they are, each from a multiple of 64 bytes on, the scene first.
Format: https://openusd.org/release/spec_usdz.html
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np

from room2dgs import __version__
from room2dgs.export.local_files import write_file
from room2dgs.export.mesh_files import NO_OFFSET
from room2dgs.export.source import Source
from room2dgs.export.text_rows import text_rows
from room2dgs.export.texture.write import Textured, jpeg_of, turned_charts

SCENE, PICTURE = "room.usda", "textures/room.jpg"
ALIGNED = 64
LOCAL_HEADER, FIELD_HEADER = 30, 4  # bytes of a file's header in a zip, and of an extra field's
PADDING = 0x1986  # USD's number of a field that means nothing
LONG_AGO = (1980, 1, 1, 0, 0, 0)  # no time in the file: equal rooms give equal bytes
# Photos have their light in them, so the picture shines and reflects nothing.
MATERIAL = """    def Material "material"
    {{
        token outputs:surface.connect = </room/material/surface.outputs:surface>

        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:emissiveColor.connect = </room/material/picture.outputs:rgb>
            float inputs:metallic = 0
            float inputs:roughness = 1
            token outputs:surface
        }}

        def Shader "picture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{picture}@
            token inputs:sourceColorSpace = "sRGB"
            float2 inputs:st.connect = </room/material/place.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }}

        def Shader "place"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
"""


def write_usdz(source: Source, path: Path) -> list[Path]:
    """One file, with y up."""
    return write_file(path, usdz(source.textured, source.y_up, source.offset_m(source.y_up)))


def usdz(textured: Textured, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """A whole package: the scene, then its picture.

    Args:
        rotation: (3, 3) from the world to a frame with y up.
        offset_m: (3,) in that frame, where the mesh stands: its vertices are floats, the translation is doubles.
    """
    return packed_zip({SCENE: scene_text(textured, rotation, offset_m), PICTURE: jpeg_of(textured.picture)})


def scene_text(textured: Textured, rotation: np.ndarray, offset_m: np.ndarray = NO_OFFSET) -> bytes:
    """The scene in USD's text format: metres, y up, one mesh with normals and places in the picture."""
    mesh = turned_charts(textured.mesh, textured.charts, rotation)
    faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices)
    ends = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    places = _rows("({}, {})", textured.charts.uv, 6)
    return b"".join(
        [
            _head(offset_m),
            b'    def Mesh "mesh" (\n        prepend apiSchemas = ["MaterialBindingAPI"]\n    )\n    {\n',
            b"        float3[] extent = [" + _rows("({}, {}, {})", ends, 6) + b"]\n",
            b"        int[] faceVertexCounts = [" + _rows("{}", np.full((len(faces), 1), 3)) + b"]\n",
            b"        int[] faceVertexIndices = [" + _rows("{}, {}, {}", faces) + b"]\n",
            b"        point3f[] points = [" + _rows("({}, {}, {})", vertices, 6) + b"]\n",
            b"        normal3f[] normals = [" + _rows("({}, {}, {})", mesh.vertex_normals, 4) + _at_vertices(),
            b"        texCoord2f[] primvars:st = [" + places + _at_vertices(),
            b'        uniform token subdivisionScheme = "none"\n',
            b"        rel material:binding = </room/material>\n    }\n\n",
            MATERIAL.format(picture=PICTURE).encode("ascii"),
            b"}\n",
        ]
    )


def _head(offset_m: np.ndarray) -> bytes:
    lines = [
        "#usda 1.0",
        "(",
        '    defaultPrim = "room"',
        f'    doc = "room2dgs {__version__}"',
        "    metersPerUnit = 1",
        '    upAxis = "Y"',
        ")",
        "",
        'def Xform "room"',
        "{",
    ]
    if offset_m.any():
        numbers = ", ".join(f"{value:.17g}" for value in offset_m)
        lines += [
            f"    double3 xformOp:translate = ({numbers})",
            '    uniform token[] xformOpOrder = ["xformOp:translate"]',
        ]
    return "\n".join([*lines, "", ""]).encode("ascii", "replace")


def _at_vertices() -> bytes:
    return b'] (\n            interpolation = "vertex"\n        )\n'


def _rows(pattern: str, values: np.ndarray, decimals: int = 0) -> bytes:
    """An array's elements, between commas."""
    return text_rows(pattern + ",", np.asarray(values), decimals).removesuffix(b",\n")


def packed_zip(files: dict[str, bytes]) -> bytes:
    """A zip as USD wants it: nothing is compressed, and each file begins at a multiple of 64 bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as package:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name, LONG_AGO)
            filled = -(buffer.tell() + LOCAL_HEADER + len(name) + FIELD_HEADER) % ALIGNED
            entry.extra = _field(filled)
            package.writestr(entry, data)
    return buffer.getvalue()


def _field(length: int) -> bytes:
    """An extra field of so many bytes."""
    return PADDING.to_bytes(2, "little") + length.to_bytes(2, "little") + bytes(length)
