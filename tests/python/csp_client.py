"""python-canopen as the master of a drive by the profile alone.

usage: csp_client.py EDS NODE INTERFACE KEY=VALUE...

EDS is the drive's data sheet; INTERFACE and the rest open the bus with python-can. The drive is a
CiA 402 drive in Cyclic Synchronous Position, just switched on, hosted with --tolerant. Ends with
code 0 and a line "ok" for each step, or with an AssertionError. Every wait is bounded.
"""

import math
import time

from canopen.profiles.p402 import BaseNode402

from master import BIT_12, OPERATION_ENABLED, STATE_MASK, aborted, ok, take_through, until

PERIOD = 0.010
AMPLITUDE = 200_000


def set_up(node):
    """PDO 3 in each direction, mode 8, 10 ms."""
    node.nmt.send_command(0x82)
    node.nmt.wait_for_bootup(3)
    assert node.sdo[0x1000].raw & 0xFFFF == 402
    assert node.sdo[0x6502].raw & 1 << 7
    assert (node.sdo[0x608F][1].raw, node.sdo[0x608F][2].raw) == (1_048_576, 1)
    # By CiA 301 a mapping is changed while its PDO is switched off.
    aborted(0x06010000, lambda: node.sdo.download(0x1A00, 0, b"\x00"))
    aborted(0x06090030, lambda: node.sdo.download(0x6060, 0, b"\x01"))
    node.tpdo.read()
    node.rpdo.read()
    for number in (1, 2, 4):
        node.tpdo[number].enabled = False
        node.rpdo[number].enabled = False
        node.tpdo[number].save()
        node.rpdo[number].save()
    for pdo, indices in ((node.rpdo[3], (0x6040, 0x607A)), (node.tpdo[3], (0x6041, 0x6064))):
        pdo.clear()
        for index in indices:
            pdo.add_variable(index)
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
    node.sdo[0x6060].raw = 8
    node.sdo[0x60C2][1].raw = round(PERIOD * 1000)
    node.sdo[0x60C2][2].raw = -3
    assert node.sdo[0x6061].raw == 8
    node.nmt.state = "OPERATIONAL"
    aborted(0x08000022, lambda: node.sdo.download(0x60C2, 1, b"\x05"))
    ok("set up")


def follow(node, seconds=3.0):
    """A cosine, every target followed by SYNC."""
    seen = {"status": 0, "position": None}

    def received(pdo):
        seen["status"], seen["position"] = pdo[0].raw, pdo[1].raw

    node.tpdo[3].add_callback(received)
    command = node.rpdo[3]
    next_cycle = time.monotonic()

    def cycle(controlword, target):
        nonlocal next_cycle
        command[0].raw, command[1].raw = controlword, target
        command.transmit()
        node.network.sync.transmit()
        next_cycle += PERIOD
        time.sleep(max(0.0, next_cycle - time.monotonic()))

    until("T_PDO3", lambda: cycle(0, 0) or seen["position"] is not None)
    start = seen["position"]
    for controlword, mask, wanted in (
        (0x06, STATE_MASK, 0x21),
        (0x0F, STATE_MASK | BIT_12, OPERATION_ENABLED | BIT_12),
    ):
        until(
            f"statusword after {controlword:02X}h",
            lambda: cycle(controlword, start) or seen["status"] & mask == wanted,
        )
    assert abs(seen["position"] - start) < 500, seen["position"] - start
    cycles = round(seconds / PERIOD)
    farthest = 0
    for k in range(cycles + 1):
        cycle(0x0F, start + round(AMPLITUDE * (1 - math.cos(2 * math.pi * k / cycles)) / 2))
        farthest = max(farthest, abs(seen["position"] - start))
    for _ in range(50):
        cycle(0x0F, start)
    assert abs(farthest - AMPLITUDE) < 4000, farthest
    assert abs(seen["position"] - start) < 500, seen["position"] - start
    ok(f"{cycles} cycles of cyclic synchronous position")
    # Quick stop, and by its option code on to Switch On Disabled.
    until("Switch On Disabled", lambda: cycle(0x0B, start) or seen["status"] & 0x4F == 0x40)
    ok("quick stop")


take_through(set_up, follow, kind=BaseNode402)
