"""SDO uploads per second by python-canopen over UDP multicast: a simulated LXM32M against
python-canopen's own LocalNode, by turns in one run. Each has a port of its own: on one bus the
LocalNode would decode the other's traffic too, and slow it down.

usage: benches/udp_throughput [SECONDS]
"""

import statistics
import subprocess
import sys
import time

import canopen

GROUP, DRIVE_PORT, LOCAL_PORT = "239.74.163.2", 43113, 43114
ROUNDS = 9


def network(port):
    network = canopen.Network()
    network.connect(interface="udp_multicast", channel=GROUP, port=port)
    return network


def serve(data_sheet):
    """A LocalNode, until standard input ends."""
    node = network(LOCAL_PORT).create_node(1, data_sheet)
    node.sdo[0x6081].raw = 60
    print("ready", flush=True)
    sys.stdin.read()


def rate(node, seconds):
    count, start = 0, time.perf_counter()
    while (now := time.perf_counter()) < start + seconds:
        node.sdo.upload(0x6081, 0)
        count += 1
    return count / (now - start)


def main(syncline, data_sheet, seconds):
    drive = subprocess.Popen(
        [syncline, "drives", "--prompt", "--node", "1:lxm32m", "--bus", f"udp://{GROUP}:{DRIVE_PORT}"],
        stdout=subprocess.PIPE,
    )
    local = subprocess.Popen(
        [sys.executable, __file__, "serve", data_sheet],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    try:
        drive.stdout.readline()
        local.stdout.readline()
        masters = network(DRIVE_PORT), network(LOCAL_PORT)
        names = "syncline drives", "python-canopen LocalNode"
        rates = [], []
        for _ in range(ROUNDS):
            for master, found in zip(masters, rates):
                node = master.nodes.get(1) or master.add_node(1, data_sheet)
                found.append(rate(node, seconds))
        medians = [statistics.median(found) for found in rates]
        for name, found, median in zip(names, rates, medians):
            spread = f"{min(found):.0f}...{max(found):.0f}"
            print(f"{name:26}{median:8.0f} uploads/s, median of {ROUNDS} x {seconds} s ({spread})")
        for master in masters:
            master.disconnect()
        return 0 if medians[0] >= medians[1] else 1
    finally:
        for process in (drive, local):
            process.terminate()
            process.wait()


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        sys.exit(serve(sys.argv[2]))
    sys.exit(main(sys.argv[1], sys.argv[2], float(sys.argv[3])))
