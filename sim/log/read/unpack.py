"""Unpacks chunks, whatever they claim to hold: a small file must not ask for much memory or time."""

import zlib

import lz4.frame
import zstandard
from mcap.records import Chunk

LARGEST_CHUNK = 64 * 2**20  # [B] unpacked; ours have 0.3 MB
LARGEST_TOTAL = 2 * 2**30  # [B] unpacked, all chunks; a minute of walking is 70 MB
LEAST_TOTAL = 16 * 2**20  # [B] that any file may unpack to
LARGEST_RATIO = 32  # unpacked to packed; ours is 1.4, as measured numbers are noise to a compressor
LEAST_MESSAGES = 100_000  # that any file may hold
LEAST_MESSAGE = 4  # [B] of the file a message; ours take 150


class Budget:
    """What a file may still unpack to, by its size."""

    def __init__(self, size: int) -> None:
        """Args: size: of the file in [B]."""
        self.most_bytes = min(LARGEST_TOTAL, LEAST_TOTAL + LARGEST_RATIO * size)
        self.most_messages = LEAST_MESSAGES + size // LEAST_MESSAGE
        self._bytes = self._messages = 0

    def take_bytes(self, count: int) -> None:
        """Count unpacked bytes.

        Raises:
            ValueError: they are too many.
        """
        if count > LARGEST_CHUNK:
            raise ValueError(f"a chunk of {count} bytes exceeds the limit of {LARGEST_CHUNK}")
        if self._bytes + count > self.most_bytes:
            raise ValueError(f"the chunks exceed {self.most_bytes} bytes together, the most for a file of this size")
        self._bytes += count

    def take_message(self) -> None:
        """Count a message.

        Raises:
            ValueError: they are too many.
        """
        self._messages += 1
        if self._messages > self.most_messages:
            raise ValueError(f"there are more than {self.most_messages} messages, the most for a file of this size")


def unpack(chunk: Chunk, budget: Budget) -> bytes:
    """The records of a chunk.

    Raises:
        ValueError: it is too large, damaged, or packed in an unknown way.
    """
    size = chunk.uncompressed_size
    if chunk.compression not in _UNPACK:
        raise ValueError(f"compression {chunk.compression!r:.40} of a chunk: must be zstd, lz4 or none")
    budget.take_bytes(size)
    data = _UNPACK[chunk.compression](chunk.data, size)
    if len(data) != size:
        raise ValueError(f"a chunk holds {len(data)} bytes and says {size}")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("CRC of a chunk is wrong")
    return data


def _plain(data: bytes, size: int) -> bytes:
    return data


def _zstd(data: bytes, size: int) -> bytes:
    declared = zstandard.frame_content_size(data)
    if declared not in (-1, size):
        raise ValueError(f"a chunk holds {declared} bytes and says {size}")
    if not size:  # zstandard takes a limit of 0 for none
        return b""
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)


def _lz4(data: bytes, size: int) -> bytes:
    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))


_UNPACK = {"": _plain, "zstd": _zstd, "lz4": _lz4}
