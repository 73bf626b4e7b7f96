"""A bench in space: drawn from one side into the page, and as a figure that can be turned.

The drawing needs neither a script nor a graphics processor, prints sharp and stands at once; who
wants to look from elsewhere asks for the figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from testbench.reporting.page.figure_parts import Figure, layout, packed, text
from testbench.reporting.page.palette import AXES_COLOURS, rgb

WIDTH, HEIGHT, EDGE = 460, 350, 26
"""Of the drawing, and what stays free about it [px]."""
ELEVATION = np.radians(20)
"""How far above the horizon it is looked at from [rad]."""
DIRECTIONS = 36
"""Directions about the vertical that are tried."""
LIGHT = np.array([0.4, 0.6, 0.8])
"""Whence the light comes, in the frame of the viewer: right, towards, up."""
DARK, BRIGHT = 104, 226
"""Grey of a face away from the light and of one towards it, legible on white and near-black."""
HOUSING = np.array([0.036, 0.030, 0.011])
"""Sides of the box that stands for a sensor [m]."""
HOUSING_COLOUR = "#f0a020"
ARROW = 0.16
"""Length of a sensor's axes, as part of the height of what is drawn."""
LETTER, LINE = 7.5, 15.0
"""Width of a letter and height of a line [px]."""


@dataclass(frozen=True)
class Body:
    """A closed surface.

    Attributes:
        corners: In the world, z up, shape (n, 3) [m].
        triangles: Rows of `corners`, counter-clockwise seen from outside, shape (m, 3).
    """

    corners: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True)
class Placed:
    """A sensor where it sits.

    Attributes:
        name: Of it.
        position: In the world, shape (3,) [m].
        R: Rotation world from sensor, shape (3, 3).
    """

    name: str
    position: np.ndarray
    R: np.ndarray


@dataclass(frozen=True)
class Scene:
    """What stands on a bench.

    Attributes:
        bodies: Of the arm.
        sensors: On it.
        floor: Height of the floor [m]; None for none.
        words: What is seen, for who cannot.
    """

    bodies: Sequence[Body]
    sensors: Sequence[Placed]
    floor: float | None
    words: str

    @property
    def corners(self) -> np.ndarray:
        """All of the bodies and sensors, shape (n, 3) [m]."""
        places = [sensor.position[None] for sensor in self.sensors]
        return np.concatenate([*(body.corners for body in self.bodies), *places])

    @property
    def size(self) -> float:
        """The longest side of a box about everything [m]."""
        return float(np.ptp(self.corners, axis=0).max())


@dataclass(frozen=True)
class View:
    """An orthographic view.

    Attributes:
        axes: Rows to the right, towards the viewer and up, in the world, shape (3, 3).
        scale: Pixels a metre.
        shift: Where the world's origin is drawn, shape (2,) [px].
    """

    axes: np.ndarray
    scale: float
    shift: np.ndarray

    def place(self, points: np.ndarray) -> np.ndarray:
        """Where points are drawn, y down.

        Args:
            points: In the world, shape (n, 3) or (3,) [m].

        Returns:
            Shape (n, 2) [px].
        """
        seen = np.atleast_2d(points) @ self.axes.T
        return np.asarray(seen[:, [0, 2]] * [self.scale, -self.scale] + self.shift)

    def towards(self, points: np.ndarray) -> np.ndarray:
        """How near to the viewer points are.

        Args:
            points: In the world, shape (n, 3) or (3,) [m].

        Returns:
            Shape (n,) [m].
        """
        return np.asarray(np.atleast_2d(points) @ self.axes[1])


def view_of(scene: Scene) -> View:
    """The view that has the sensors in front, apart from one another, and the arm wide."""
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    axes = max((_axes(angle) for angle in angles), key=lambda own: _merit(scene, own))
    ends = _arrow_ends(scene).reshape(-1, 3)
    flat = np.concatenate([scene.corners, ends]) @ axes.T
    low, high = flat[:, [0, 2]].min(axis=0), flat[:, [0, 2]].max(axis=0)
    room = np.array([WIDTH - 2 * EDGE, HEIGHT - 2 * EDGE])
    scale = float((room / np.maximum(high - low, 1e-6)).min())
    middle = (low + high) / 2
    shift = np.array([WIDTH / 2, HEIGHT / 2]) - middle * [scale, -scale]
    return View(axes, scale, shift)


def _axes(azimuth: float) -> np.ndarray:
    c, s = np.cos(azimuth), np.sin(azimuth)
    ce, se = np.cos(ELEVATION), np.sin(ELEVATION)
    return np.array([[-s, c, 0.0], [ce * c, ce * s, se], [-se * c, -se * s, ce]])


def _merit(scene: Scene, axes: np.ndarray) -> float:
    """How well a direction shows a scene."""
    seen = scene.corners @ axes.T
    size = scene.size
    wide = float(np.ptp(seen[:, 0])) / size
    if not scene.sensors:
        return wide
    own = np.array([sensor.position for sensor in scene.sensors]) @ axes.T
    front = float(np.mean(own[:, 1]) - np.mean(seen[:, 1])) / size
    flat = own[:, [0, 2]]
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(flat) for b in flat[:i]]
    apart = min(float(min(gaps)) / size, 0.4) if gaps else 0.0
    return 0.6 * wide + front + 1.5 * apart


def _arrow_ends(scene: Scene) -> np.ndarray:
    """Tips of the sensors' axes, shape (sensors, 3 axes, 3) [m]."""
    if not scene.sensors:
        return np.zeros((0, 3, 3))
    length = ARROW * scene.size
    return np.array([s.position + length * s.R.T for s in scene.sensors])


def _housing(sensor: Placed) -> Body:
    """The box of a sensor, a little larger than life, so that it shows."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = 0.6 * signs * HOUSING @ sensor.R.T + sensor.position
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corner for a, b, c, d in faces for corner in ((a, b, c), (a, c, d))]
    return Body(corners, np.array(triangles))


# One piece: the parts of the drawing in the order in which they lie above one another.
def drawing(scene: Scene) -> str:
    """The scene as SVG, whose words take the colours of the page."""
    view = view_of(scene)
    named = f'role="img" aria-label="{escape(scene.words)}" font-size="13"'
    parts = [f'<svg class="scene" viewBox="0 0 {WIDTH} {HEIGHT}" {named}>']
    if scene.floor is not None:
        parts.append(_floor(scene, view))
    faces = [_faces(body, view, None) for body in scene.bodies]
    faces += [_faces(_housing(sensor), view, HOUSING_COLOUR) for sensor in scene.sensors]
    ordered = sorted((face for own in faces for face in own), key=lambda face: face[0])
    parts.append('<g fill="currentColor" stroke="currentColor" stroke-width=".7">')
    parts += [face[1] for face in ordered]
    parts.append("</g>")
    taken: list[np.ndarray] = []
    arrows, words = [], []
    for sensor, ends in zip(scene.sensors, _arrow_ends(scene), strict=True):
        start = view.place(sensor.position)[0]
        for (axis, colour), end in zip(AXES_COLOURS.items(), view.place(ends), strict=True):
            arrows.append(_arrow(start, end, colour))
            words.append((axis, end + _beyond(start, end), colour))
    for sensor in scene.sensors:
        words.append((sensor.name, view.place(sensor.position)[0] + [0, 26], "var(--ink)"))
    parts += arrows
    for said, place, colour in sorted(words, key=lambda word: -len(word[0])):
        parts += _word(said, place, colour, taken)
    return "".join([*parts, "</svg>"])


def _faces(body: Body, view: View, colour: str | None) -> list[tuple[float, str]]:
    """Faces towards the viewer: how near each is, and its drawing."""
    corners = body.corners[body.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sizes = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(sizes, 1e-12)[:, None] @ view.axes.T
    light = np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    near = view.towards(corners.reshape(-1, 3)).reshape(-1, 3).mean(axis=1)
    flat = view.place(corners.reshape(-1, 3)).reshape(-1, 3, 2)
    drawn = []
    for i in np.flatnonzero((normals[:, 1] > 1e-3) & (sizes > 1e-9)):
        if colour is None:
            grey = round(DARK + (BRIGHT - DARK) * light[i])
            shade = f"#{grey:02x}{grey:02x}{grey + 6:02x}"
        else:
            shade = "#{:02x}{:02x}{:02x}".format(
                *(round(part * (0.62 + 0.38 * light[i])) for part in rgb(colour))
            )
        a, b, c = flat[i]
        path = f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}L{c[0]:.1f} {c[1]:.1f}Z"
        drawn.append((float(near[i]), f'<path color="{shade}" d="{path}"/>'))
    return drawn


def _floor(scene: Scene, view: View) -> str:
    """A grid of squares of 0.2 m below the arm."""
    middle, half = scene.corners.mean(axis=0), 0.2 * np.round(scene.size / 2 / 0.2)
    steps = np.arange(-half, half + 0.01, 0.2)
    centre = np.round(middle[:2] / 0.2) * 0.2
    lines = []
    for step in steps:
        for ends in ([(step, -half), (step, half)], [(-half, step), (half, step)]):
            points = np.array([[*(end + centre), scene.floor] for end in np.array(ends)])
            (x0, y0), (x1, y1) = view.place(points)
            lines.append(f"M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}")
    return f'<path class="floor" fill="none" d="{"".join(lines)}"/>'


def _arrow(start: np.ndarray, end: np.ndarray, colour: str) -> str:
    along = end - start
    length = float(np.linalg.norm(along))
    ends = f"M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}"
    if length > 6:
        ahead = along / length
        aside = np.array([-ahead[1], ahead[0]])
        for side in (1, -1):
            barb = end - 6 * ahead + side * 3 * aside
            ends += f"M{end[0]:.1f} {end[1]:.1f}L{barb[0]:.1f} {barb[1]:.1f}"
    return f'<path fill="none" stroke="{colour}" stroke-width="2" d="{ends}"/>'


def _beyond(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A little further along an arrow [px]."""
    along = end - start
    return np.asarray(along / max(float(np.linalg.norm(along)), 1e-6) * 9)


def _word(said: str, place: np.ndarray, colour: str, taken: list[np.ndarray]) -> list[str]:
    """Words about a place, beside those that stand there; none where there is no room."""
    half = np.array([max(len(said), 1) * LETTER / 2, LINE / 2])
    for aside in ((0, 0), (0, LINE), (0, -LINE), (0, 2 * LINE), (LETTER * 2, 0), (-LETTER * 2, 0)):
        middle = np.clip(place + aside, half, np.array([WIDTH, HEIGHT]) - half)
        if all((np.abs(middle - other[:2]) >= half + other[2:]).any() for other in taken):
            taken.append(np.concatenate([middle, half]))
            x, y = middle[0], middle[1] + 4.5
            place_of = f'x="{x:.1f}" y="{y:.1f}" text-anchor="middle" style="fill:{colour}"'
            return [f"<text {place_of}>{escape(said)}</text>"]
    return []


def turnable(scene: Scene) -> Figure:
    """The same as a figure of plotly's, which can be turned."""
    view = view_of(scene)
    corners = np.concatenate([body.corners for body in scene.bodies])
    first = np.cumsum([0, *(len(body.corners) for body in scene.bodies)])
    rows = np.concatenate([b.triangles + n for b, n in zip(scene.bodies, first, strict=False)])
    data = [_mesh("arm", corners, rows, "#a9adb3")]
    for sensor, ends in zip(scene.sensors, _arrow_ends(scene), strict=True):
        box = _housing(sensor)
        data.append(_mesh(text(sensor.name), box.corners, box.triangles, HOUSING_COLOUR))
        for (axis, colour), end in zip(AXES_COLOURS.items(), ends, strict=True):
            line = np.array([sensor.position, end])
            data.append(
                {
                    "type": "scatter3d",
                    "mode": "lines+text",
                    "name": text(f"{sensor.name} {axis}"),
                    **{key: packed(line[:, i]) for i, key in enumerate("xyz")},
                    "text": ["", axis],
                    "textfont": {"color": colour},
                    "line": {"color": colour, "width": 6},
                    "hoverinfo": "name",
                    "showlegend": False,
                }
            )
    eye = 1.6 * view.axes[1]
    bare = {"visible": False}
    figure = layout(460, margin={"l": 0, "r": 0, "t": 0, "b": 0})
    figure["scene"] = {
        "aspectmode": "data",
        "xaxis": dict(bare),
        "yaxis": dict(bare),
        "zaxis": dict(bare),
        "camera": {
            "eye": {key: round(float(value), 3) for key, value in zip("xyz", eye, strict=True)},
            "projection": {"type": "orthographic"},
        },
    }
    return {"data": data, "layout": figure}


def _mesh(name: str, corners: np.ndarray, triangles: np.ndarray, colour: str) -> Figure:
    return {
        "type": "mesh3d",
        "name": name,
        **{key: packed(corners[:, i]) for i, key in enumerate("xyz")},
        **{key: triangles[:, i].tolist() for i, key in enumerate("ijk")},
        "color": colour,
        "flatshading": True,
        "hoverinfo": "name",
        "lighting": {"ambient": 0.55, "diffuse": 0.6, "specular": 0.05},
    }
