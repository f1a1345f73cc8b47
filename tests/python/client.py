"""python-canopen as the master of two simulated drives.

usage: client.py EDS all|resting INTERFACE KEY=VALUE...

EDS is the drives' data sheet; INTERFACE and the rest open the bus with python-can. The drives are
LXM32Ms with node ids 1 and 2, just switched on, hosted with --tolerant; "resting" does only what
moves none. Ends with code 0 and a line "ok" for each step, or with an AssertionError. Every wait is
bounded.
"""

import math
import sys
import time

from canopen.profiles.p402 import BaseNode402

from master import (
    BIT_12, OPERATION_ENABLED, STATE_MASK, TARGET_REACHED, aborted, connected, ok, until,
)

X_END = 1 << 14


def network_management(network, node):
    node.nmt.send_command(0x82)
    node.nmt.wait_for_bootup(3)
    assert node.nmt.state == "PRE-OPERATIONAL", node.nmt.state
    ok("boot-up after reset communication")
    node.sdo[0x1017].raw = 50
    for state in ["OPERATIONAL", "STOPPED", "PRE-OPERATIONAL"]:
        node.nmt.state = state
        # The heartbeat already under way may tell the old state.
        until(state, lambda: node.nmt.wait_for_heartbeat(1) == state)
    ok("NMT commands, seen in the heartbeat")
    node.sdo[0x1017].raw = 0


def objects(node):
    assert node.sdo[0x1000].raw == 0x00420192
    assert node.sdo[0x1018][1].raw == 0x0800005A
    assert node.sdo[0x1008].raw.rstrip() == "LXM32M"
    ok("expedited and segmented upload")
    speed = node.sdo[0x6081]
    speed.raw = 321
    assert speed.raw == 321
    assert node.sdo.upload(0x6081, 0) == (321).to_bytes(4, "little")
    ok("download, read back")
    sdo = node.sdo
    aborted(0x06010002, lambda: sdo.download(0x1000, 0, bytes(4)))
    aborted(0x06020000, lambda: sdo.upload(0x5F00, 0))
    aborted(0x06090011, lambda: sdo.upload(0x1018, 9))
    aborted(0x06070012, lambda: sdo.download(0x6040, 0, bytes(4)))
    aborted(0x06070013, lambda: sdo.download(0x6040, 0, bytes(1)))
    aborted(0x06090030, lambda: sdo.download(0x1029, 1, b"\x07"))
    aborted(0x06040041, lambda: map_alone(node.tpdo[4], 0x1008))
    ok("abort codes")


def map_alone(pdo, index):
    """Maps one object, by hand."""
    pdo.com_record[1].raw = pdo.com_record[1].raw | 1 << 31
    pdo.map_array[0].raw = 0
    pdo.map_array[1].raw = index << 16 | 0x20


def process_data(node):
    """T_PDO1 with statusword, mode and actual position, R_PDO1 with controlword and mode."""
    node.tpdo.read()
    node.rpdo.read()
    status, command = node.tpdo[1], node.rpdo[1]
    assert [v.index for v in status.map] == [0x6041]
    assert [v.index for v in command.map] == [0x6040]
    status.clear()
    for index in (0x6041, 0x6061, 0x6064):
        status.add_variable(index)
    status.trans_type = 255
    status.event_timer = 20
    status.enabled = True
    status.save()
    command.clear()
    for index in (0x6040, 0x6060):
        command.add_variable(index)
    command.save()
    assert node.sdo[0x1A00][3].raw == 0x60640020
    node.nmt.state = "OPERATIONAL"
    for _ in range(3):
        assert status.wait_for_reception(1), "no T_PDO1"
    assert status[0x6041].raw == node.sdo[0x6041].raw
    assert abs(status[0x6064].raw - node.sdo[0x6064].raw) <= 16
    command[0x6040].raw = 0
    command[0x6060].raw = 3
    command.transmit()
    until("mode 3 by R_PDO", lambda: node.sdo[0x6061].raw == 3)
    ok("PDOs both ways with another mapping")


def enable(node):
    node.setup_402_state_machine(read_pdos=False)
    node.tpdo[1].wait_for_reception(1)
    node.state = "OPERATION ENABLED"
    assert node.statusword & STATE_MASK == OPERATION_ENABLED
    ok("p402: OPERATION ENABLED")


def home(node):
    node.sdo[0x6098].raw = 34
    assert node.homing(timeout=10), hex(node.statusword)
    ok("p402: homed")


def move_to(node, target):
    node.op_mode = "PROFILED POSITION"
    node.sdo[0x6083].raw = 6000
    node.sdo[0x6084].raw = 6000
    node.sdo[0x6081].raw = 600
    node.controlword = 0x0F
    node.sdo[0x607A].raw = target
    node.controlword = 0x1F
    until("set-point acknowledged", lambda: node.statusword & BIT_12)
    node.controlword = 0x0F
    reached = TARGET_REACHED | X_END
    until("target", lambda: node.statusword & reached == reached, 5)
    assert abs(node.sdo[0x6064].raw - target) <= 16
    ok("profile position")


def turn(node):
    node.op_mode = "PROFILED VELOCITY"
    node.sdo[0x60FF].raw = 300
    until("speed", lambda: abs(node.sdo[0x606C].raw - 300) <= 5)
    node.sdo[0x60FF].raw = 0
    until("standstill", lambda: abs(node.sdo[0x606C].raw) <= 2)
    ok("profile velocity")


def fault(network, node):
    """The drive loses its master's heartbeat while it is enabled."""
    emergencies = []
    node.emcy.add_callback(emergencies.append)
    # Stays Operational then, and so keeps sending its statusword.
    node.sdo[0x1029][1].raw = 1
    heartbeat = network.send_periodic(0x77F, [5], 0.05)
    node.sdo[0x1016][1].raw = 127 << 16 | 500
    time.sleep(0.2)
    assert node.statusword & STATE_MASK == OPERATION_ENABLED
    heartbeat.stop()
    until("FAULT", lambda: node.state == "FAULT")
    until("EMCY", lambda: emergencies)
    assert emergencies[0].code == 0x8130, hex(emergencies[0].code)
    assert node.sdo[0x603F].raw != 0
    ok("fault, EMCY 8130h")
    node.sdo[0x1016][1].raw = 0
    # python-canopen waits in vain for the fault to go by controlword 0 alone, then goes on.
    node.reset_from_fault()
    assert node.state == "OPERATION ENABLED", node.state
    until("EMCY 0000h", lambda: emergencies[-1].code == 0)
    ok("fault reset")
    node.state = "SWITCH ON DISABLED"


def interpolation_setup(node, period_ms):
    """As the manual prints it, with the PDOs set up by python-canopen."""
    node.nmt.state = "PRE-OPERATIONAL"
    node.tpdo.read()
    node.rpdo.read()
    for number in (1, 3, 4):
        node.tpdo[number].enabled = False
        node.rpdo[number].enabled = False
        node.tpdo[number].save()
        node.rpdo[number].save()
    for pdo, variables in (
        (node.rpdo[2], [(0x6040, 0), (0x60C1, 1)]),
        (node.tpdo[2], [(0x6041, 0), (0x6064, 0)]),
    ):
        pdo.clear()
        for index, subindex in variables:
            pdo.add_variable(index, subindex)
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
    node.sdo[0x3006][0x07].raw = 131072
    node.sdo[0x3006][0x08].raw = 1
    node.sdo[0x6060].raw = 7
    node.sdo[0x3006][0x3D].raw = 1
    node.sdo[0x60C2][1].raw = period_ms
    for index, subindex, value in (
        (0x3012, 6, 1000),
        (0x3013, 6, 1000),
        (0x3006, 6, 1),
        (0x3022, 4, 1),
        (0x3022, 5, 2),
    ):
        node.sdo[index][subindex].raw = value


class Axis:
    """A drive in Interpolated Position."""

    def __init__(self, node):
        self.node = node
        self.status = 0
        self.position = None
        self.command = node.rpdo[2]
        node.tpdo[2].add_callback(self.received)

    def received(self, pdo):
        self.status, self.position = pdo[0].raw, pdo[1].raw

    def send(self, controlword, setpoint):
        self.command[0].raw = controlword
        self.command[1].raw = setpoint
        self.command.transmit()


def interpolate(network, nodes, seconds=5.0, period=0.010):
    """A cosine on two drives, one period each, every setpoint followed by SYNC."""
    for node in nodes:
        interpolation_setup(node, round(period * 1000))
    axes = [Axis(node) for node in nodes]
    for node in nodes:
        node.nmt.state = "OPERATIONAL"
    next_cycle = time.monotonic()

    def cycle(controlword, setpoints):
        nonlocal next_cycle
        for axis, setpoint in zip(axes, setpoints):
            axis.send(controlword, setpoint)
        network.sync.transmit()
        next_cycle += period
        time.sleep(max(0.0, next_cycle - time.monotonic()))

    until("T_PDO2 of both", lambda: cycle(0, [0, 0]) or all(a.position is not None for a in axes))
    start = [axis.position for axis in axes]
    for controlword, mask, wanted in (
        (0x06, STATE_MASK, 0x21),
        (0x0F, STATE_MASK, OPERATION_ENABLED),
        (0x1F, BIT_12, BIT_12),
    ):
        until(
            f"statusword after {controlword:02X}h",
            lambda: cycle(controlword, start) or all(a.status & mask == wanted for a in axes),
        )
    amplitude = (131072, -65536)
    cycles = round(seconds / period)
    farthest = [0, 0]
    before = start
    for k in range(cycles + 1):
        part = (1 - math.cos(2 * math.pi * k / cycles)) / 2
        setpoints = [s + round(a * part) for s, a in zip(start, amplitude)]
        cycle(0x1F, setpoints)
        for i, axis in enumerate(axes):
            assert axis.status & (STATE_MASK | BIT_12) == OPERATION_ENABLED | BIT_12
            farthest[i] = max(farthest[i], abs(axis.position - start[i]))
            # Late cycles of an ordinary computer cost a few setpoints, no more.
            assert abs(axis.position - before[i]) < 20_000, "far from the path"
        before = setpoints
    for _ in range(50):
        cycle(0x1F, start)
    for i, axis in enumerate(axes):
        assert abs(farthest[i] - abs(amplitude[i])) < 500, farthest
        assert abs(axis.position - start[i]) < 100, axis.position - start[i]
    for controlword in (0x0F, 0x06, 0x00):
        for _ in range(20):
            cycle(controlword, start)
    for axis in axes:
        assert axis.status & STATE_MASK in (0x21, 0x60, 0x40), hex(axis.status)
    ok(f"{cycles} cycles of interpolated position on {len(nodes)} drives")


def main():
    data_sheet, steps, *bus = sys.argv[1:]
    with connected(*bus) as network:
        nodes = [network.add_node(BaseNode402(id, data_sheet)) for id in (1, 2)]
        first = nodes[0]
        network.scanner.search(10)
        until("both nodes", lambda: sorted(network.scanner.nodes) == [1, 2])
        ok("scanned")
        network_management(network, first)
        objects(first)
        process_data(first)
        if steps == "resting":
            return
        enable(first)
        home(first)
        move_to(first, 30_000)
        turn(first)
        fault(network, first)
        interpolate(network, nodes)


if __name__ == "__main__":
    sys.exit(main())
