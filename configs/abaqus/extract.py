"""Runs the job and writes the deflection of some nodes as a table: `abaqus python extract.py JOB`.

ABAQUS' own Python reads its output database; the study reads the table.
"""
import subprocess
import sys

from odbAccess import openOdb

POSITIONS = {3: 0.2, 5: 0.4, 7: 0.6, 9: 0.8, 11: 1.0}  # m from the clamp, by node

job = sys.argv[-1]
subprocess.check_call(["abaqus", "job=" + job, "input=beam.inp", "interactive"])
odb = openOdb(job + ".odb", readOnly=True)
displacement = odb.steps.values()[-1].frames[-1].fieldOutputs["U"]
with open("deflection.csv", "w") as table:
    table.write("position [m],deflection [m]\n")
    for value in displacement.values:
        if value.nodeLabel in POSITIONS:
            table.write("%r,%r\n" % (POSITIONS[value.nodeLabel], -float(value.data[1])))
odb.close()
