"""Bytes that zlib or zstd has packed: whether they are whole, and how much they hold."""

import sys
import zlib

LARGEST_CODE = 1 << 28  # bytes, not compressed
# zlib packs zeros so many times; entries that are smaller than that cannot be too large.
_DENSEST = 1032
_STEP, _ZSTD = 1 << 20, b"\x28\xb5\x2f\xfd"


def inflated(data: bytes, maximum: int) -> bytes:
    """Content of what zlib has packed, if it is all there and no larger than it may be."""
    reader = zlib.decompressobj()
    try:
        content = reader.decompress(data, maximum)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not reader.eof:
        raise ValueError("it is not whole, or too large")
    return content


def is_whole(data: bytes) -> bool:
    """Tell whether packed code is all there: a full disk, or the end of the process, may have left half of it."""
    if data[:1] == b"x":  # zlib's
        return _is_whole_zlib(data)
    for module in ("compression.zstd", "zstandard"):
        if (zstd := sys.modules.get(module)) is not None:
            return _is_whole_zstd(zstd, data)
    return bool(data)


def _is_whole_zlib(data: bytes) -> bool:
    reader, length = zlib.decompressobj(), 0
    try:
        while not reader.eof and length <= LARGEST_CODE:
            part = reader.decompress(data, _STEP)
            data, length = reader.unconsumed_tail, length + len(part)
            if not part and not data:
                break
    except zlib.error:
        return False
    return reader.eof and length <= LARGEST_CODE


def _is_whole_zstd(zstd, data: bytes) -> bool:
    # Two libraries of nearly the same interface; jax takes the one that there is.
    reader = zstd.ZstdDecompressor()
    try:
        if hasattr(reader, "decompressobj"):
            reader = reader.decompressobj()
        reader.decompress(data)
    except zstd.ZstdError:
        return False
    return bool(reader.eof)


def is_too_large(data: bytes) -> bool:
    """Tell whether packed code holds more than it may: jax would inflate it at one go."""
    if data.startswith(_ZSTD):
        return _zstd_length(data) > LARGEST_CODE
    return len(data) > LARGEST_CODE // _DENSEST and not is_whole(data)


def _zstd_length(data: bytes) -> int:
    # The head of a frame says the size of its content (RFC 8878, 3.1.1.1), or not: 0.
    head = data[len(_ZSTD)] if len(data) > len(_ZSTD) else 0
    is_single, width = head >> 5 & 1, (head >> 5 & 1, 2, 4, 8)[head >> 6]
    start = len(_ZSTD) + 2 - is_single + (0, 1, 2, 4)[head & 3]
    return int.from_bytes(data[start : start + width], "little") + (256 if width == 2 else 0)
