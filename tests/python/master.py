"""What every master here has: the bus that its arguments name, waits that end, aborts that are meant."""

import struct
import sys
import threading
import time
from contextlib import contextmanager

import canopen
from canopen.profiles.p402 import BaseNode402

STATE_MASK = 0x6F
OPERATION_ENABLED = 0x27
TARGET_REACHED, BIT_12 = 1 << 10, 1 << 12

# A host that others share may keep a state from coming for longer than python-canopen waits by itself.
BaseNode402.TIMEOUT_SWITCH_OP_MODE = 10.0
BaseNode402.TIMEOUT_SWITCH_STATE_FINAL = 10.0
BaseNode402.TIMEOUT_SWITCH_STATE_SINGLE = 10.0


class Network(canopen.Network):
    """Deaf to what only a master sends.

    Over UDP python-can hears its own frames; python-canopen then takes its R_PDOs for periodic
    ones and does not send them when told to.
    """

    R_PDOS = (0x200, 0x300, 0x400, 0x500)

    def notify(self, can_id, data, timestamp):
        if can_id & 0x780 not in self.R_PDOS:
            super().notify(can_id, data, timestamp)


def ok(what):
    print("ok:", what, flush=True)


def until(what, condition, seconds=3.0):
    """Waits until the condition holds; fails after some seconds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds} s: {what}"
        time.sleep(0.005)


@contextmanager
def received(pdo, what):
    """Holds that a T_PDO comes in within a second of what the body does, however soon."""
    came = threading.Event()

    def note(_pdo):
        came.set()

    pdo.add_callback(note)
    yield
    assert came.wait(1), what
    pdo.callbacks.remove(note)


def aborted(code, access):
    """Asserts that an access is aborted with this code."""
    try:
        access()
    except canopen.SdoAbortedError as error:
        assert error.code == code, f"{error.code:08X} instead of {code:08X}"
    else:
        raise AssertionError(f"not aborted with {code:08X}")


def protocol_aborts(node, index):
    """Asserts what an SDO server refuses whatever the object is; the one at index has four bytes, which may be written."""
    request = node.sdo.request_response
    address = struct.pack("<HB", index, 0)

    def begin(size):
        return request(b"\x21" + address + struct.pack("<I", size))

    aborted(0x05040001, lambda: request(b"\xe0" + address + bytes(4)))
    aborted(0x06070012, lambda: begin(1 << 20))
    begin(4)
    aborted(0x05030000, lambda: request(b"\x17" + bytes(7)))
    begin(4)
    # Two bytes, and no more of them.
    aborted(0x06070010, lambda: request(b"\x0b" + bytes(7)))


def silence_aborts(node, index):
    """Asserts that a transfer whose client has gone silent is given up, five seconds later; the object has four bytes."""
    sdo = node.sdo
    sdo.request_response(b"\x21" + struct.pack("<HB", index, 0) + struct.pack("<I", 4))
    timeout, sdo.RESPONSE_TIMEOUT = sdo.RESPONSE_TIMEOUT, 10
    try:
        aborted(0x05040000, sdo.read_response)
    finally:
        sdo.RESPONSE_TIMEOUT = timeout


def connected(interface, *options):
    """The network on the bus that python-can opens with an interface and options KEY=VALUE."""
    options = dict(option.split("=", 1) for option in options)
    if "port" in options:
        options["port"] = int(options["port"])
    network = Network()
    network.connect(interface=interface, **options)
    return network


def take_through(*steps, kind=canopen.RemoteNode):
    """Takes the node of the arguments EDS NODE INTERFACE KEY=VALUE... through steps, functions of it."""
    data_sheet, number, *bus = sys.argv[1:]
    with connected(*bus) as network:
        node = network.add_node(kind(int(number), data_sheet))
        node.sdo.RESPONSE_TIMEOUT = 1
        for step in steps:
            step(node)


def answers(node):
    """The node's device type, or 0 as long as it does not answer."""
    try:
        return node.sdo[0x1000].raw
    except canopen.SdoCommunicationError:
        return 0


def word(node):
    """The statusword."""
    return node.sdo[0x6041].raw
