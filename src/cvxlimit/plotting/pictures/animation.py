"""The mechanism in motion: GIF and MP4, and what notebooks show of it."""

from __future__ import annotations

import base64
import io
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.checks import count
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError, ModelError
from cvxlimit.plotting.contents import Drawing, Viewer
from cvxlimit.plotting.look import Saved
from cvxlimit.plotting.picture import seen
from cvxlimit.plotting.pictures.mechanism import mechanism_of
from cvxlimit.plotting.registry import figures, listed
from cvxlimit.results.movement import Motion
from cvxlimit.solution import Solution

Bytes = NDArray[np.uint8]

DPI = 100
SECONDS = 2.4
"""From rest to the largest displacement and back."""


@dataclass(frozen=True, eq=False)
class Animation(Saved):
    """Frames of a moving picture; notebooks show it when it ends a cell.

    Attributes
    ----------
    frames : sequence of (height, width, 3) uint8 arrays
        From rest to the largest displacement and back, in colour.
    seconds : float
        Of one such cycle.
    """

    suffixes = (".gif", ".mp4")

    frames: Sequence[Bytes]
    seconds: float = SECONDS

    @property
    def gif(self) -> bytes:
        """The animation as a GIF that runs for ever."""
        from PIL import Image

        palette = Image.new("P", (1, 1))  # the farthest frame has all colours
        palette.putpalette(_palette(self.frames[len(self.frames) // 2]))
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
        ffmpeg = needed("imageio_ffmpeg", "video", "MP4 files (a .gif needs no more)")
        height, width = (2 * (side // 2) for side in self.frames[0].shape[:2])
        with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
            target = Path(folder) / "animation.mp4"
            writer = ffmpeg.write_frames(
                target, (width, height), fps=len(self.frames) / self.seconds, quality=None,
                output_params=["-crf", "20"], macro_block_size=2, ffmpeg_log_level="error",
            )  # fmt: skip
            try:
                writer.send(None)
                for frame in 4 * [*self.frames]:
                    writer.send(np.ascontiguousarray(frame[:height, :width]))
                writer.close()
                return target.read_bytes()
            except (OSError, RuntimeError) as error:
                raise ModelError(f"ffmpeg could not write the video: {error}") from error

    def file(self, kind: str) -> bytes:
        """Returns the film as a ``gif`` or ``mp4``."""
        return self.gif if kind == "gif" else self.mp4

    def _repr_html_(self) -> str:
        data = base64.b64encode(self.gif).decode("ascii")
        return f'<img alt="mechanism in motion" src="data:image/gif;base64,{data}">'

    def __repr__(self) -> str:
        height, width = self.frames[0].shape[:2]
        return f"Animation({len(self.frames)} frames of {width} x {height})"


@listed
def animation(
    solution: Solution, *, frames: int = 20, magnification: float = 1.0, viewer: Viewer = None,
    **options: Any,
) -> Animation:  # fmt: skip
    """The mechanism in motion, from rest to its largest displacement and back.

    Parameters
    ----------
    solution : Solution
        With its scene and a mechanism.
    frames : int
        Of a cycle, 4 or more and even; half of them are drawn, forth as back.
    magnification, viewer
        As for :func:`~cvxlimit.plotting.mechanism`.
    options
        ``figsize``, ``title`` and ``legend``: those of :func:`~cvxlimit.plotting.picture`.

    Raises
    ------
    InputError
        For a solution without its scene or without a mechanism.
    ModelError
        For a number of frames that is not even, or below 4, or without Matplotlib.
    """
    number = count(frames, 4, "frames of an animation")
    if number % 2:
        raise ModelError(f"frames of an animation must be even, got {number}")
    drawing = mechanism_of(solution.scene, solution, magnification, viewer)
    moving = drawing.moving
    if not moving.moves:
        raise InputError(
            f"the solution of {solution.scene_name!r} has no mechanism ({solution.status}): there "
            "is nothing to set in motion"
        )
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, number // 2 + 1))
    motions = [replace(moving, scale=share * moving.scale) for share in shares.tolist()]
    return Animation(forth_and_back(frames_of(drawing, motions, **options)))


ALIKE = 0xF8F8F8
"""Bits of red, green and blue that tell colours apart in a palette: 8 levels of 256 do not show."""


def _palette(frame: Bytes) -> bytes:
    """The commonest colours of a frame, as they are: Pillow's own palettes hold means, in which
    purple became magenta. Of nearly equal colours one is kept: it might take another for white."""
    red, green, blue = np.moveaxis(frame.astype(np.int32), -1, 0)
    found, counts = np.unique((red << 16) | (green << 8) | blue, return_counts=True)
    commonest = found[np.argsort(-counts, kind="stable")]
    _, first = np.unique(commonest & ALIKE, return_index=True)
    kept = commonest[np.sort(first)[:256]]
    return np.stack([kept >> 16, (kept >> 8) & 255, kept & 255], axis=1).astype(np.uint8).tobytes()


def forth_and_back(frames: Sequence[Bytes]) -> tuple[Bytes, ...]:
    """Frames from the first to the last, and back to the second."""
    return (*frames, *frames[-2:0:-1])


def frames_of(
    drawing: Drawing, motions: Sequence[Motion], texts: Sequence[str] = (), **options: Any
) -> list[Bytes]:
    """Pixels of a drawing in each of its motions, with a text below the title.

    All are drawn on one figure: the blocks of the last one are removed, everything else stays.
    """
    made = figures()
    figure, shown = made.assembled(drawing, seen(drawing), **options)
    figure.set_dpi(DPI)
    axes, texts = figure.axes[0], texts or [""] * len(motions)
    said = axes.set_title(texts[0], fontsize=8, pad=14)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    frames = []
    for motion, text in zip(motions, texts, strict=True):
        for artist in shown:
            artist.remove()
        shown = made.draw_seen(axes, seen(replace(drawing, moving=motion)), 1.0)
        said.set_text(text)
        frames.append(figure.pixels())
    return frames
