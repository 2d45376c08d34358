"""Where pictures go: a film, a moving picture, a still."""

import contextlib
import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from sim.errors import UserError
from sim.review.film.camera import Pixels

KINDS = (".mp4", ".gif", ".png")
MOST_PIXELS = 4096  # on a side
COLOURS = 128  # of a GIF; all its pictures share them, so that what stands still stays the same byte for byte


def check(target: Path, size: tuple[int, int]) -> None:
    """See before drawing that a file of its kind can be made.

    Raises:
        UserError: it cannot.
    """
    if target.suffix not in KINDS:
        raise UserError(f"{target}: must end in one of {', '.join(KINDS)}")
    if target.exists():
        raise UserError(f"{target}: already exists and is never overwritten; choose another name")
    if not target.parent.is_dir():
        raise UserError(f"{target}: {target.parent} is no folder; make it first or choose another path")
    if not all(16 <= side <= MOST_PIXELS for side in size):
        raise UserError(f"--size {size[0]} {size[1]} pixels: each must be within 16 and {MOST_PIXELS}")
    needed = ("PIL", "imageio", "imageio_ffmpeg") if target.suffix == ".mp4" else ("PIL",)
    missing = [name for name in needed if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(f'{target.suffix} needs the packages of the extra "video": pip install "cmpc-walker[video]"')


@contextlib.contextmanager
def writer(target: Path, fps: float) -> Iterator[Callable[[Pixels], None]]:
    """Takes pictures; nothing is left behind when drawing fails.

    Args:
        target: The file, of one of `KINDS`.
        fps: Pictures in a second of film [1/s].

    Raises:
        UserError: it cannot be written.
    """
    try:
        if target.suffix == ".mp4":
            import imageio.v2

            video: Any = imageio.v2.get_writer(target, fps=fps, codec="libx264", quality=8, macro_block_size=2)
            with video:
                yield video.append_data
            return
        pictures: list[Pixels] = []
        yield pictures.append
        _save(target, pictures, fps)
    except OSError as error:
        target.unlink(missing_ok=True)
        raise UserError(f"{target}: cannot be written: {error.strerror or error}") from error
    except BaseException:
        target.unlink(missing_ok=True)
        raise


def _save(target: Path, pictures: list[Pixels], fps: float) -> None:
    import numpy as np
    from PIL import Image

    if target.suffix == ".png":
        Image.fromarray(pictures[0]).save(target, optimize=True)
        return
    some = pictures[:: max(1, len(pictures) // 8)]
    plain = Image.Dither.NONE  # dots of mixed colours flicker and do not pack
    octree = Image.Quantize.FASTOCTREE  # the median cut drops hues of thin things, such as arrows
    palette = Image.fromarray(np.concatenate(some)).quantize(COLOURS, octree, dither=plain)
    images = [Image.fromarray(one).quantize(palette=palette, dither=plain) for one in pictures]
    images[0].save(target, save_all=True, append_images=images[1:], duration=round(1000 / fps), loop=0, optimize=False)
