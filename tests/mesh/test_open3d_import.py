"""open3d comes without dash, and whoever asks for dash afterwards gets it."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import sys
from room2dgs.mesh.open3d import o3c, o3d
assert o3c is sys.modules["open3d.core"] and o3d.geometry.TriangleMesh
print([name for name in sys.modules if name.partition(".")[0] == "dash"])
drawing = sys.modules["open3d.visualization.draw_plotly"]
page = drawing.Dash("page")
page.layout = drawing.html.Div(drawing.dcc.Graph())
import dash
print(type(page) is dash.Dash, dash.html.Div is drawing.html.Div, bool(dash.__version__))
"""


def test_dash_is_imported_when_it_is_used_and_not_before():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "True True True"]
