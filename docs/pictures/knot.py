"""Draw the picture of the README: exact distances, isolines, and a path that follows a point.

    python docs/pictures/knot.py

It needs the extra ``plot``, and takes a minute.
"""

from pathlib import Path

import numpy as np
import pyvista
from PIL import Image

import geodesic_core as gc

FRAMES = 72
MS_A_FRAME = 60
SIZE = (1040, 520)
BACKGROUND, NIGHT = "#16202e", "#0a0f17"
LINES, PATH = "#f8fafc", "#ff3b30"
LEVELS = 36
VIEW_ANGLE = 31.0  # degrees
QUALITY = 62


def main() -> None:
    """Draw the frames, and write them into one file."""
    mesh = gc.samples.knot(60_000)
    height = mesh.vertices[:, 2]
    source = int(np.argmax(mesh.vertices[:, 0] + 0.7 * height))
    field = gc.exact_distance(mesh, source, retain="windows")
    plotter = pyvista.Plotter(off_screen=True, window_size=SIZE, lighting="three lights")
    plotter.set_background(NIGHT, top=BACKGROUND)
    plotter.enable_anti_aliasing("ssaa")
    surface = field.to_pyvista()
    plotter.add_mesh(
        surface,
        scalars="distance",
        cmap="viridis",
        smooth_shading=True,
        specular=0.35,
        specular_power=25,
        show_scalar_bar=False,
    )
    levels = np.linspace(0, field.distances.max(), LEVELS + 2)[1:-1]
    for lines in field.isolines(levels):
        for line in lines:
            plotter.add_mesh(tube(line.points, 0.006), color=LINES)
    plotter.add_mesh(ball(mesh.vertices[source]), color=PATH)

    around = len(mesh.vertices) // FRAMES
    turn = 2 * np.pi / FRAMES
    frames = []
    for number in range(FRAMES):
        ring = number * around  # vertices are numbered along the knot
        path = field.path_to(ring + int(np.argmax(height[ring : ring + around])))
        moving = [
            plotter.add_mesh(tube(path.points, 0.035), color=PATH, specular=0.5),
            plotter.add_mesh(ball(path.points[-1]), color=PATH),
        ]
        sway = np.sin(number * turn), np.cos(number * turn)
        eye = (1.6 * sway[0], -6.0 + 0.5 * sway[1], 9.4)
        plotter.camera_position = [eye, (0.2, -0.25, 0), (0, 1, 0)]
        plotter.camera.view_angle = VIEW_ANGLE
        plotter.render()
        frames.append(Image.fromarray(plotter.screenshot(return_img=True)))
        for actor in moving:
            plotter.remove_actor(actor)
    first, *rest = frames
    file = Path(__file__).with_suffix(".webp")
    options = {"duration": MS_A_FRAME, "loop": 0, "quality": QUALITY, "method": 6}
    first.save(file, save_all=True, append_images=rest, **options)


def tube(points: np.ndarray, radius: float) -> pyvista.PolyData:
    """Return a tube around a polyline."""
    return pyvista.lines_from_points(points).tube(radius=radius, n_sides=10)


def ball(centre: np.ndarray) -> pyvista.PolyData:
    """Return the mark of an end."""
    return pyvista.Sphere(radius=0.075, center=centre)


if __name__ == "__main__":
    main()
