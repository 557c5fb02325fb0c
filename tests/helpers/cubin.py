"""What a compiled CUDA kernel needs of the device, read from its cubin: registers per thread, and memory beside them."""

import struct
from pathlib import Path
from typing import NamedTuple

REGISTERS, FRAME = 0x2F, 0x11  # attributes of .nv.info that hold a symbol and a number
WORD_PAIR = 0x04  # format of an attribute with a length


class Resources(NamedTuple):
    """Of one kernel."""

    registers: int
    """Per thread."""
    frame: int
    """Local memory per thread: spilled registers and arrays with an index not known before [B]."""


def read(path: Path) -> dict[str, Resources]:
    """Resources of each kernel of a cubin (ELF, 64 bit, little endian), by name."""
    data = path.read_bytes()
    assert data[:6] == b"\x7fELF\x02\x01", f"{path.name} is no cubin"
    (table,) = struct.unpack_from("<Q", data, 40)
    size, count, names_at = struct.unpack_from("<HHH", data, 58)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, table + size * k) for k in range(count)]

    def text(strings: int, offset: int) -> str:
        begin = sections[strings][4] + offset
        return data[begin : data.index(b"\0", begin)].decode()

    symbols: dict[int, str] = {}
    numbers: dict[int, list[tuple[int, int]]] = {REGISTERS: [], FRAME: []}
    for name, kind, _, _, at, length, link, _, _, entry in sections:
        if kind == 2:  # symbol table
            symbols = {k: text(link, struct.unpack_from("<I", data, at + k * entry)[0]) for k in range(length // entry)}
        elif text(names_at, name) == ".nv.info":
            end = at + length
            while at < end:
                form, attribute, value = struct.unpack_from("<BBH", data, at)
                at += 4
                if form == WORD_PAIR:
                    if attribute in numbers:
                        numbers[attribute].append(struct.unpack_from("<II", data, at))
                    at += value
    frames = dict(numbers[FRAME])
    return {symbols[k]: Resources(registers, frames.get(k, 0)) for k, registers in numbers[REGISTERS]}
