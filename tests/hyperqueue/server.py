"""A HyperQueue server with one worker, from the Python package; ends with its standard input.

    python3 server.py FOLDER CORES
"""

import sys

from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig

folder, cores = sys.argv[1], int(sys.argv[2])
with LocalCluster(server_dir=folder, worker_config=WorkerConfig(cores=cores)):
    print("ready", flush=True)
    sys.stdin.read()
