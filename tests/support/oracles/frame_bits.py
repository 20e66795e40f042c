"""A CAN frame written out as a string of bits, for tests: slow, plain, and nothing of it from ``drives``.

The check sum is the remainder of a division of polynomials written out by hand, stuffing is a search for
five equal characters. What is asserted of frame lengths is asserted against this.
"""

from __future__ import annotations

from collections.abc import Iterator

GENERATOR = "1100010110011001"  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
TAIL = (
    "1" + "01" + "1111111" + "111"
)  # CRC delimiter, ACK (driven by a receiver) and its delimiter, EOF, pause


def length(can_id: int, data: bytes = b"", remote: bool = False, extended: bool = False) -> int:
    """Bits on the wire from SOF to the end of the interframe space."""
    return len(on_the_wire(can_id, data, remote, extended))


def on_the_wire(can_id: int, data: bytes = b"", remote: bool = False, extended: bool = False) -> str:
    """The whole frame, stuffed."""
    rtr = "1" if remote else "0"
    if extended:
        name = f"{can_id:029b}"
        head = "0" + name[:11] + "11" + name[11:] + rtr + "00"
    else:
        head = "0" + f"{can_id:011b}" + rtr + "00"
    body = head + f"{len(data):04b}" + ("" if remote else "".join(f"{byte:08b}" for byte in data))
    return stuffed(body + remainder(body)) + TAIL


def remainder(bits: str) -> str:
    """Of bits * x^15 divided by the generator, over GF(2)."""
    left = int(bits, 2) << 15
    divisor = int(GENERATOR, 2)
    while left.bit_length() > 15:
        left ^= divisor << (left.bit_length() - 16)
    return f"{left:015b}"


def stuffed(bits: str) -> str:
    """After five equal bits one of the other value; it may itself be the first of the next five."""
    done = ""
    for bit in bits:
        done += bit
        if done[-5:] in ("00000", "11111"):
            done += "1" if bit == "0" else "0"
    return done


def frames_of(can_id: int, data_bytes: int, at_least: int) -> Iterator[bytes]:
    """Every payload that makes the frame ``at_least`` so long, by branch and bound over its bits.

    From a run of r equal bits, R bits more can hold (R + r - 1) // 4 stuff bits at most: a way on which
    that does not reach the wanted number is left. The check sum is looked at when all bits are chosen.
    """
    head = "0" + f"{can_id:011b}" + "000" + f"{data_bytes:04b}"
    bits = 8 * data_bytes
    wanted = at_least - (len(head) + bits + 15 + len(TAIL))
    ways = [(stuffed(head), 0, "")]
    while ways:
        sent, chosen, data = ways.pop()
        run = len(sent) - len(sent.rstrip(sent[-1]))
        if len(sent) - len(head) - chosen + (bits - chosen + 15 + run - 1) // 4 < wanted:
            continue
        if chosen == bits:
            payload = int("0" + data, 2).to_bytes(data_bytes, "big")
            if length(can_id, payload) >= at_least:
                yield payload
            continue
        for bit in (sent[-1], "1" if sent[-1] == "0" else "0")[::-1]:
            more = sent + bit
            if more[-5:] in ("00000", "11111"):
                more += "1" if bit == "0" else "0"
            ways.append((more, chosen + 1, data + bit))
