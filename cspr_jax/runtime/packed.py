"""Bytes that zlib or zstd has compressed: checks of completeness and of size before they are unpacked."""

import sys
import zlib

LARGEST_CODE = 1 << 28  # bytes before compression
_DENSEST = 1032  # largest ratio of compression by zlib, which zeros attain
_STEP, _ZSTD = 1 << 20, b"\x28\xb5\x2f\xfd"


def inflated(data: bytes, maximum: int) -> bytes:
    """Unpack bytes that zlib has compressed; they must be complete, and contain at most `maximum` bytes."""
    reader = zlib.decompressobj()
    try:
        content = reader.decompress(data, maximum)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    if not reader.eof:
        raise ValueError("it is not whole, or too large")
    return content


def is_complete(data: bytes) -> bool:
    """Tell whether compressed code is complete; a full disk, or the end of a process, may have left a part of it."""
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
    # Two libraries with nearly the same interface; jax uses the one that is installed.
    reader = zstd.ZstdDecompressor()
    try:
        if hasattr(reader, "decompressobj"):
            reader = reader.decompressobj()
        reader.decompress(data)
    except zstd.ZstdError:
        return False
    return bool(reader.eof)


def is_too_large(data: bytes) -> bool:
    """Tell whether compressed code contains too many bytes, since jax would unpack all at once."""
    if data.startswith(_ZSTD):
        return _zstd_length(data) > LARGEST_CODE
    return len(data) > LARGEST_CODE // _DENSEST and not is_complete(data)


def _zstd_length(data: bytes) -> int:
    # The header of a frame may give the length of its content (RFC 8878, 3.1.1.1); 0 where it does not.
    head = data[len(_ZSTD)] if len(data) > len(_ZSTD) else 0
    is_single, width = head >> 5 & 1, (head >> 5 & 1, 2, 4, 8)[head >> 6]
    start = len(_ZSTD) + 2 - is_single + (0, 1, 2, 4)[head & 3]
    return int.from_bytes(data[start : start + width], "little") + (256 if width == 2 else 0)
