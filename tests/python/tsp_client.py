"""python-canopen as the master of a stepper controller TSP10-CBE.

usage: tsp_client.py EDS NODE INTERFACE KEY=VALUE...

EDS is the controller's data sheet; INTERFACE and the rest open the bus with python-can. It has just
been switched on. Ends with code 0 and a line "ok" for each step, or with an AssertionError. Every wait
is bounded.
"""

import struct

from master import (
    TARGET_REACHED, aborted, answers, ok, protocol_aborts, silence_aborts, take_through, until,
    word,
)

REFERENCED = 1 << 8


def bring_up(node):
    until("an answer", lambda: answers(node), 5)
    assert node.sdo[0x1000].raw == 0x00040192
    assert node.sdo[0x1008].raw == "TSP"
    assert node.sdo[0x1002].raw & 0xFF == node.id
    node.tpdo.read()
    assert [v.index for v in node.tpdo[2].map] == [0x6041, 0x606C]
    for index, value in (
        (0x6075, 3000), (0x6081, 20_000), (0x6083, 100_000), (0x6084, 100_000), (0x609A, 100_000),
    ):
        node.sdo[index].raw = value
    node.sdo[0x6099][1].raw = 10_000
    ok("set up")


def aborts(node):
    """All that the server has; 0800 0022h, which it has while it is enabled, is provoked in `move`."""
    sdo = node.sdo
    aborted(0x06010002, lambda: sdo.download(0x6099, 2, bytes(4)))
    protocol_aborts(node, 0x607A)
    silence_aborts(node, 0x607A)
    aborted(0x06020000, lambda: sdo.upload(0x1017, 0))
    aborted(0x06070012, lambda: sdo.download(0x6040, 0, bytes(4)))
    aborted(0x06070013, lambda: sdo.download(0x6040, 0, bytes(1)))
    aborted(0x06090011, lambda: sdo.upload(0x6040, 1))
    for index, data in [
        (0x6060, b"\x07"),
        (0x6075, struct.pack("<I", 399)),
        (0x6083, struct.pack("<I", 22)),
        (0x6098, b"\x01"),
    ]:
        aborted(0x06090030, lambda: sdo.download(index, 0, data))
    ok("abort codes")


def move(node):
    for command, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        node.sdo[0x6040].raw = command
        until(f"state {state:02X}", lambda state=state: word(node) & 0x6F == state)
    aborted(0x08000022, lambda: node.sdo.download(0x2002, 0, bytes(2)))
    node.sdo[0x6060].raw = 6
    node.sdo[0x607C].raw = 5000
    node.sdo[0x6040].raw = 0x1F
    until("referenced", lambda: node.sdo[0x1002].raw & REFERENCED)
    assert node.sdo[0x6064].raw == 5000
    ok("homed")
    node.sdo[0x6040].raw = 0x0F
    node.sdo[0x6060].raw = 1
    node.sdo[0x607A].raw = 25_000
    node.sdo[0x6040].raw = 0x1F
    until("target", lambda: word(node) & TARGET_REACHED, 5)
    assert node.sdo[0x6064].raw == 25_000
    ok("profile position")
    node.sdo[0x6040].raw = 0x0F
    node.sdo[0x6060].raw = 3
    node.sdo[0x60FF].raw = -1000
    until("speed", lambda: node.sdo[0x606C].raw == -1000)
    node.sdo[0x6040].raw = 0x10F
    until("halt", lambda: node.sdo[0x606C].raw == 0)
    ok("profile velocity and halt")


take_through(bring_up, aborts, move)
