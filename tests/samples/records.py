"""Writes the samples of records from `base.csv`: signals B and C in microstrain, times in milliseconds.

Needs numpy, h5py, scipy and hdf5storage.
"""

import os

import h5py
import hdf5storage
import numpy as np
import scipy.io

table = np.genfromtxt("base.csv", delimiter=",", names=True)
signals = {name: table[name] for name in ("B", "C")}
time = 0.01 * np.arange(1, 101)

with h5py.File("records.h5", "w") as file:
    for name, signal in signals.items():
        data = file.create_dataset(f"strain_{name}", data=signal, chunks=(50,), compression="gzip")
        data.attrs["units"] = "microstrain"
    file["time"] = time
    file["time"].attrs["unit"] = "ms"

record = {"strain": np.stack(list(signals.values()), axis=1), "t": time[:, None]}
scipy.io.savemat("records.mat", {"record": record}, do_compression=True)
scipy.io.savemat("records_plain.mat", {"record": record})
if os.path.exists("records_73.mat"):
    os.remove("records_73.mat")
hdf5storage.savemat("records_73.mat", {"record": record}, format="7.3", oned_as="column")
