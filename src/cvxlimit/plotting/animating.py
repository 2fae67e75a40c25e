"""The mechanism in motion: GIF and MP4, and what notebooks show of it."""

from __future__ import annotations

import base64
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image

from cvxlimit.checks import count
from cvxlimit.errors import InputError, ModelError
from cvxlimit.files import write_file
from cvxlimit.plotting.drawing import assembled, camera_for
from cvxlimit.plotting.mesh import drawn_mesh
from cvxlimit.plotting.movement import motion, velocity_of
from cvxlimit.plotting.picture import frame_of, paint
from cvxlimit.plotting.results import Viewer, magnified, mechanism_drawing
from cvxlimit.solution import Solution

Bytes = NDArray[np.uint8]

_PIXELS = 640
_DPI = 100
_SECONDS = 2.4
"""From rest to the largest displacement and back."""


@dataclass(frozen=True, eq=False)
class Animation:
    """Frames of a moving picture; notebooks show it when it ends a cell.

    Attributes
    ----------
    frames : sequence of (height, width, 3) uint8 arrays
        From rest to the largest displacement and back, in colour.
    seconds : float
        Of one such cycle.
    """

    frames: Sequence[Bytes]
    seconds: float = _SECONDS

    @property
    def gif(self) -> bytes:
        """The animation as a GIF that runs for ever."""
        palette = _palette(self.frames[len(self.frames) // 2])  # the farthest one has all colours
        images = map(Image.fromarray, self.frames)
        shown = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
        buffer = io.BytesIO()
        pause = round(1000 * self.seconds / len(shown))
        shown[0].save(buffer, "GIF", save_all=True, append_images=shown[1:], duration=pause, loop=0)
        return buffer.getvalue()

    @property
    def mp4(self) -> bytes:
        """The animation as an MP4 (H.264) of four cycles.

        Raises
        ------
        ModelError
            If ffmpeg is not installed, or refuses.
        """
        height, width = (2 * (side // 2) for side in self.frames[0].shape[:2])
        rate = len(self.frames) / self.seconds
        with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
            target = Path(folder) / "animation.mp4"
            command = [
                _ffmpeg(), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
                "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "-", "-an",
                "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", str(target),
            ]  # fmt: skip
            raw = b"".join(frame[:height, :width].tobytes() for frame in self.frames) * 4
            done = subprocess.run(command, input=raw, capture_output=True, check=False)
            if done.returncode or not target.exists():
                said = done.stderr.decode(errors="replace").strip().splitlines()
                raise ModelError(f"ffmpeg could not write the video: {said[-1] if said else '?'}")
            return target.read_bytes()

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a ``.gif`` or ``.mp4``; returns the file's path.

        Raises
        ------
        InputError
            For another suffix or a folder that cannot be written to.
        ModelError
            If an MP4 is asked for and ffmpeg is not installed.
        """
        target = Path(path)
        suffix = target.suffix.lower()
        if suffix not in (".gif", ".mp4"):
            raise InputError(
                f"an animation is written as .gif or .mp4, got {target.name!r}: a page (.html) "
                "moves as well"
            )
        write_file(target, self.gif if suffix == ".gif" else self.mp4)
        return target

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.gif).decode("ascii")
        return f'<img alt="mechanism in motion" src="data:image/gif;base64,{data}">'

    def __repr__(self) -> str:
        height, width = self.frames[0].shape[:2]
        return f"Animation({len(self.frames)} frames of {width} x {height})"


def animation(
    solution: Solution, *, frames: int = 20, magnification: float = 1.0, viewer: Viewer = None
) -> Animation:
    """The mechanism in motion, from rest to its largest displacement and back.

    Parameters
    ----------
    solution : Solution
        With its scene and a mechanism.
    frames : int
        Of a cycle, 4 or more and even; half of them are drawn, forth as back.
    magnification, viewer
        As for :func:`~cvxlimit.plotting.mechanism`.

    Raises
    ------
    InputError
        For a solution without its scene or without a mechanism.
    ModelError
        For a number of frames that is not even, or below 4.
    """
    scene = solution.drawn_scene
    number = count(frames, 4, "frames of an animation")
    if number % 2:
        raise ModelError(f"frames of an animation must be even, got {number}")
    moving = magnified(motion(scene, solution), magnification)
    if not moving.moves:
        raise InputError(
            f"the solution of {solution.scene!r} has no mechanism ({solution.status}): there is "
            "nothing to set in motion"
        )
    camera = camera_for(scene, moving, viewer)
    mesh = drawn_mesh(scene)
    shift = moving.scale * velocity_of(scene, moving.rates, mesh.points, mesh.point_block)
    ends = np.concatenate([mesh.points, mesh.points + shift])
    frame = frame_of(camera.project(ends), _PIXELS)
    drawing = mechanism_drawing(scene, solution, moving)

    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, number // 2 + 1))
    last = paint(scene, moving, camera, marking=drawing.marking, frame=frame)
    figure, image = assembled(scene, moving, camera, drawing, last)
    figure.set_dpi(_DPI)
    canvas = FigureCanvasAgg(figure)

    def painted(share: float) -> NDArray[np.float32]:
        part = replace(moving, scale=share * moving.scale)
        marking, ghost = drawing.marking, last.ghost
        return paint(scene, part, camera, marking=marking, frame=frame, ghost=ghost).image

    forth: list[Bytes] = []
    for share in shares.tolist():
        image.set_data(painted(share))
        canvas.draw()  # type: ignore[no-untyped-call]
        shown = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        forth.append(shown[:, :, :3].copy())
    return Animation((*forth, *forth[-2:0:-1]))


_ALIKE = 0xF8F8F8
"""Bits of red, green and blue that tell colours apart in a palette: 8 levels of 256 do not show."""


def _palette(frame: Bytes) -> Image.Image:
    """The commonest colours of a frame, as they are: areas, lines and keys of the legend.

    Pillow's own palettes hold means, in which the purple of small swatches became magenta. Of
    colours that are nearly the same one is kept: it might take another for white.
    """
    red, green, blue = np.moveaxis(frame.astype(np.int32), -1, 0)
    found, counts = np.unique((red << 16) | (green << 8) | blue, return_counts=True)
    commonest = found[np.argsort(-counts, kind="stable")]
    _, first = np.unique(commonest & _ALIKE, return_index=True)
    kept = commonest[np.sort(first)[:256]]
    colours = np.stack([kept >> 16, (kept >> 8) & 255, kept & 255], axis=1).astype(np.uint8)
    result = Image.new("P", (1, 1))
    result.putpalette(colours.tobytes())
    return result


def _ffmpeg() -> str:
    """The program ffmpeg: installed as such, or brought by imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found is not None:
        return found
    try:
        program: str = import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise ModelError(
            'MP4 needs ffmpeg: pip install "cvxlimit[video]", or write a .gif'
        ) from error
    return program
