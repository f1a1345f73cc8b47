"""SDO uploads per second by python-canopen over UDP multicast: a simulated LXM32M against
python-canopen's own LocalNode, by turns in one run.

usage: benches/udp_throughput [SECONDS]
"""

import subprocess
import sys
import time

import canopen

GROUP, PORT = "239.74.163.2", 43113
ROUNDS = 5


def network():
    network = canopen.Network()
    network.connect(interface="udp_multicast", channel=GROUP, port=PORT)
    return network


def serve(data_sheet):
    """A LocalNode with node id 2, until standard input ends."""
    node = network().create_node(2, data_sheet)
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
        [syncline, "drives", "--prompt", "--node", "1:lxm32m", "--bus", f"udp://{GROUP}:{PORT}"],
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
        master = network()
        nodes = {
            "syncline drives": master.add_node(1, data_sheet),
            "python-canopen LocalNode": master.add_node(2, data_sheet),
        }
        best = dict.fromkeys(nodes, 0.0)
        for _ in range(ROUNDS):
            for name, node in nodes.items():
                best[name] = max(best[name], rate(node, seconds))
        for name, uploads in best.items():
            print(f"{name:26}{uploads:8.0f} uploads/s, best of {ROUNDS} x {seconds} s")
        master.disconnect()
        ours, theirs = best.values()
        return 0 if ours >= theirs else 1
    finally:
        for process in (drive, local):
            process.terminate()
            process.wait()


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        sys.exit(serve(sys.argv[2]))
    sys.exit(main(sys.argv[1], sys.argv[2], float(sys.argv[3])))
