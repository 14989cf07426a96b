"""Bytes that zlib or zstd has compressed: whether they are complete, and how much they hold."""

import sys
import zlib

LARGEST_CODE = 1 << 28  # bytes, not compressed
_DENSEST = 1032  # largest ratio of compression by zlib, that of zeros
_STEP, _ZSTD = 1 << 20, b"\x28\xb5\x2f\xfd"


def inflated(data: bytes, maximum: int) -> bytes:
    """Content of bytes that zlib has compressed; they must be complete, and hold no more than `maximum`."""
    reader = zlib.decompressobj()
    try:
        content = reader.decompress(data, maximum)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not reader.eof:
        raise ValueError("it is not whole, or too large")
    return content


def is_complete(data: bytes) -> bool:
    """Tell whether compressed code is complete: a full disk, or the end of the process, may have left half of it."""
    if data[:1] == b"x":  # zlib's
        return _is_complete_zlib(data)
    for module in ("compression.zstd", "zstandard"):
        if (zstd := sys.modules.get(module)) is not None:
            return _is_complete_zstd(zstd, data)
    return bool(data)


def _is_complete_zlib(data: bytes) -> bool:
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


def _is_complete_zstd(zstd, data: bytes) -> bool:
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
    """Tell whether compressed code holds more than it may: jax would inflate it at one go."""
    if data.startswith(_ZSTD):
        return _zstd_length(data) > LARGEST_CODE
    return len(data) > LARGEST_CODE // _DENSEST and not is_complete(data)


def _zstd_length(data: bytes) -> int:
    # The head of a frame may say how long its content is (RFC 8878, 3.1.1.1); 0 where it does not.
    head = data[len(_ZSTD)] if len(data) > len(_ZSTD) else 0
    is_single, width = head >> 5 & 1, (head >> 5 & 1, 2, 4, 8)[head >> 6]
    start = len(_ZSTD) + 2 - is_single + (0, 1, 2, 4)[head & 3]
    return int.from_bytes(data[start : start + width], "little") + (256 if width == 2 else 0)
