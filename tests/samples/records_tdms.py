"""Writes the samples of TDMS files, and what npTDMS reads in them.

`records.tdms`: the signals B and C of `base.csv` in microstrain as waveforms, in three segments. `types.tdms`: a channel of each
type that npTDMS writes, and scaled ones; `types.csv` holds their numbers as npTDMS reads them, moments in seconds since the first.

Needs numpy and npTDMS.
"""

import csv

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter
from nptdms.timestamp import TimestampArray

table = np.genfromtxt("base.csv", delimiter=",", names=True)
waveform = {"unit_string": "microstrain", "wf_increment": 1e-5, "wf_start_offset": 1e-5, "wf_samples": 1}
with TdmsWriter("records.tdms") as file:
    for part in np.split(np.arange(100), [40, 70]):
        file.write_segment(
            [RootObject({"title": "strain gauges"}), GroupObject("strain")]
            + [ChannelObject("strain", name, table[name][part], waveform) for name in ("B", "C")]
        )

KINDS = ["int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64"]


def extremes(kind):
    """Smallest and largest number of a type, of those that are exact in double precision, and others."""
    if kind.startswith("float"):
        info = np.finfo(kind)
        return np.array([info.min, info.max, info.tiny, -0.0, np.inf, np.nan, 0.1, 1.5], kind)
    info = np.iinfo(kind)
    low, high = max(info.min, -(2**53)), min(info.max, 2**53)
    return np.array([low, high, 0, 1, 2, 3, high - 1, high // 3], kind)


linear = {
    "NI_Scaling_Status": "unscaled",
    "NI_Number_Of_Scales": np.uint32(2),
    "NI_Scale[0]_Scale_Type": "Linear",
    "NI_Scale[0]_Linear_Slope": 0.25,
    "NI_Scale[0]_Linear_Y_Intercept": -3.0,
    "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),
    "NI_Scale[1]_Scale_Type": "Polynomial",
    "NI_Scale[1]_Polynomial_Coefficients_Size": np.uint32(3),
    "NI_Scale[1]_Polynomial_Coefficients[0]": 1.0,
    "NI_Scale[1]_Polynomial_Coefficients[1]": 0.5,
    "NI_Scale[1]_Polynomial_Coefficients[2]": 2.0,
    "NI_Scale[1]_Polynomial_Input_Source": np.uint32(0),
}
of_group = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
            "NI_Scale[0]_Linear_Slope": 2.0, "NI_Scale[0]_Linear_Y_Intercept": 1.0}
strain_gauge = {"NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Strain"}
start = 3_800_000_000
moments = TimestampArray(np.array(
    [((i % 4) * 2**62 + 12345, start + i // 4) for i in range(8)],
    dtype=[("second_fractions", "<u8"), ("seconds", "<i8")],
))
with TdmsWriter("types.tdms") as file:
    for _ in range(2):
        numbers = [ChannelObject("types", kind, extremes(kind)) for kind in KINDS]
        file.write_segment(
            [GroupObject("scaled", of_group), *numbers]
            + [
                ChannelObject("types", "boolean", np.array([True, False] * 4)),
                ChannelObject("Dr. T's/group", "it's 5/8", np.arange(8.0)),
                ChannelObject("types", "time", moments),
                ChannelObject("scaled", "polynomial", np.arange(8, dtype="int16"), linear),
                ChannelObject("scaled", "of group", np.arange(8, dtype="int16")),
            ]
        )
    file.write_segment([
        ChannelObject("types", "text", ["a", "text"]),
        ChannelObject("types", "complex", np.array([1j, 2.0])),
        ChannelObject("types", "gauge", np.arange(2.0), strain_gauge),
    ])

columns = {}
for group in TdmsFile.read("types.tdms", raw_timestamps=True).groups():
    for channel in group.channels():
        if channel.name in ("text", "complex", "gauge"):
            continue
        values = channel[:]
        if channel.name == "time":
            ticks = [(int(t.seconds) << 64) + int(t.second_fractions) for t in values]
            values = [(t - ticks[0]) / 2**64 for t in ticks]
        columns[f"{group.name}/{channel.name}"] = [repr(float(x)) for x in values]
with open("types.csv", "w", newline="") as out:
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values()))
