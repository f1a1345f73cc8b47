"""python-canopen as the master of a positioning controller TLC53x.

usage: tlc_client.py EDS NODE INTERFACE KEY=VALUE...

EDS is the controller's data sheet; INTERFACE and the rest open the bus with python-can. It has just
been switched on. Ends with code 0 and a line "ok" for each step, or with an AssertionError. Every wait
is bounded.
"""

import struct

from master import (
    TARGET_REACHED, aborted, answers, ok, protocol_aborts, received, silence_aborts, take_through,
    until, word,
)

ACKNOWLEDGED = 1 << 12


def bring_up(node):
    until("an answer", lambda: answers(node), 5)
    assert node.sdo[0x1000].raw == 0x00020192
    assert node.sdo[0x1018][1].raw == 0x0100002E
    assert node.sdo[0x6404].raw == "SIG Positec BL"
    ok("expedited and segmented upload")
    node.tpdo.read()
    node.rpdo.read()
    assert [v.index for v in node.tpdo[2].map] == [0x6041, 0x6064]
    assert [v.index for v in node.rpdo[3].map] == [0x6040, 0x60FF]
    ok("mappings as the manual prints them")


def aborts(node):
    """All that the server has but 0800 0021h, for which a panel has to have control."""
    sdo = node.sdo
    aborted(0x06010000, lambda: sdo.upload(0x1400, 4))
    protocol_aborts(node, 0x607A)
    silence_aborts(node, 0x607A)
    aborted(0x06010001, lambda: sdo.upload(0x6060, 0))
    aborted(0x06010002, lambda: sdo.download(0x6041, 0, bytes(2)))
    aborted(0x06020000, lambda: sdo.upload(0x100E, 0))
    aborted(0x06040041, lambda: remap(sdo, [0x60630020]))
    aborted(0x06040042, lambda: remap(sdo, [0x60640020] * 3))
    aborted(0x06040043, lambda: guard_and_beat(sdo))
    aborted(0x06070012, lambda: sdo.download(0x6040, 0, bytes(4)))
    aborted(0x06070013, lambda: sdo.download(0x6040, 0, bytes(1)))
    aborted(0x06090011, lambda: sdo.upload(0x6040, 1))
    aborted(0x06090030, lambda: sdo.download(0x6060, 0, b"\x07"))
    aborted(0x06090031, lambda: sdo.download(0x6081, 0, struct.pack("<I", 3001)))
    aborted(0x06090036, lambda: sdo.download(0x2053, 0, struct.pack("<i", 2**31 - 1)))
    ok("abort codes")


def remap(sdo, entries):
    sdo.download(0x1A02, 0, b"\x00")
    for place, entry in enumerate(entries, 1):
        sdo.download(0x1A02, place, struct.pack("<I", entry))
    sdo.download(0x1A02, 0, bytes([len(entries)]))


def guard_and_beat(sdo):
    sdo.download(0x100C, 0, struct.pack("<H", 100))
    sdo.download(0x100D, 0, b"\x02")
    try:
        sdo.download(0x1017, 0, struct.pack("<H", 50))
    finally:
        sdo.download(0x100D, 0, b"\x00")


def enable(node):
    for command, state in ((0x06, 0x21), (0x07, 0x23), (0x0F, 0x27)):
        node.sdo[0x6040].raw = command
        until(f"state {state:02X}", lambda state=state: word(node) & 0x6F == state)
    aborted(0x08000022, lambda: node.sdo.download(0x2045, 0, struct.pack("<H", 1)))
    ok("operation enabled")


def home(node):
    """Where it is becomes zero: absolute targets need a reference point."""
    node.sdo[0x6060].raw = 6
    node.sdo[0x6098].raw = 35
    node.sdo[0x6040].raw = 0x1F
    until("homing attained", lambda: word(node) & ACKNOWLEDGED)
    node.sdo[0x6040].raw = 0x0F
    ok("homed")


def move(node):
    node.sdo[0x6060].raw = 1
    for index in (0x6083, 0x6084):
        node.sdo[index].raw = 6000
    node.sdo[0x6081].raw = 1200
    node.sdo[0x607A].raw = 100_000
    # Bit 6 set is absolute, as the manual prints it.
    node.sdo[0x6040].raw = 0x5F
    until("set-point acknowledged", lambda: word(node) & ACKNOWLEDGED)
    node.sdo[0x6040].raw = 0x4F
    until("target", lambda: word(node) & TARGET_REACHED, 5)
    assert abs(node.sdo[0x6064].raw - 100_000) <= 10
    ok("profile position")


def stream(node):
    """Velocities by R_PDO3 at each SYNC, positions by T_PDO2."""
    node.nmt.state = "PRE-OPERATIONAL"
    command, status = node.rpdo[3], node.tpdo[2]
    for pdo in (command, status):
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
    node.sdo[0x6060].raw = 3
    node.nmt.state = "OPERATIONAL"
    for velocity in (100, 200, 300, 300, 300, 300, 0):
        command[0x6040].raw = 0x0F
        command[0x60FF].raw = velocity
        command.transmit()
        with received(status, "no T_PDO2 after SYNC"):
            node.network.sync.transmit()
    before = node.sdo[0x6064].raw
    assert status[0x6041].raw & 0x6F == 0x27
    until("standstill", lambda: abs(node.sdo[0x606C].raw) <= 2, 5)
    assert before > 100_000
    ok("velocities by PDO at SYNC")


take_through(bring_up, aborts, enable, home, move, stream)
