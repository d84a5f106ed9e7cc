//! Files written by scipy and hdf5storage.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use super::open;

const WRITE: &str = r#"
import sys, numpy as np, scipy.io
x = np.arange(24).reshape(2, 3, 4)
data = {"cube_" + kind: x.astype(kind) for kind in
        ["f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8"]}
pulses = np.empty((1, 2), dtype=[("t", "O"), ("s", "O")])
for i in range(2):
    pulses[0, i] = (np.arange(3.0)[:, None], np.array([[i, 10.5, np.nan]]))
cells = np.empty((2,), dtype=object)
cells[0], cells[1] = np.array([[1.5, 2.5]]), "text"
data |= {"pulse": pulses, "cells": cells, "one": {"inner": {"a": 7.0}}, "name": "a text", "z": np.array([[1j]]),
         "nothing": np.zeros((0, 0)), "logical": np.array([[True, False]])}
scipy.io.savemat(sys.argv[1], data, do_compression=sys.argv[2] == "packed", oned_as="column")
"#;

#[test]
fn matrices_of_scipy_are_read() {
    let Ok(python) = std::env::var("LACUNA_PYTHON") else {
        println!("skipped: LACUNA_PYTHON names no interpreter that has scipy");
        return;
    };
    let has = Command::new(&python).args(["-c", "import scipy"]).output().unwrap();
    if !has.status.success() {
        println!("skipped: {python} does not have scipy");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("written.mat");
    for packing in ["packed", "plain"] {
        let arguments = [path.to_str().unwrap(), packing];
        let output = Command::new(&python).args(["-c", WRITE]).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let file = open(&path).unwrap();
        let right: Vec<f64> = (0..24).map(f64::from).collect();
        let cubes: Vec<&String> = file.names().iter().filter(|n| n.starts_with("cube")).collect();
        assert_eq!(cubes.len(), 10);
        for name in cubes {
            let cube = file.array(name).unwrap();
            assert_eq!((&cube.shape[..], &cube.values), (&[2, 3, 4][..], &right), "{name}");
        }
        let values = |name: &str| file.array(name).unwrap().values;
        assert_eq!(values("pulse(2).t"), [0.0, 1.0, 2.0]);
        assert_eq!(values("pulse(2).s")[..2], [1.0, 10.5]);
        assert!(values("pulse(1).s")[2].is_nan());
        assert_eq!(file.array("pulse(1).s").unwrap().shape, [1, 3]);
        assert_eq!(values("cells(1)"), [1.5, 2.5]);
        assert_eq!(values("one.inner.a"), [7.0]);
        assert_eq!(values("logical"), [1.0, 0.0]);
        assert!(values("nothing").is_empty());
        for (name, right) in [("name", "does not hold numbers"), ("z", "holds complex numbers")] {
            let error = file.array(name).unwrap_err().to_string();
            assert!(error.contains(right) && error.contains(name), "{error}");
        }
    }
}

/// A file of MATLAB on another machine: the header says `MI`, and every number is in the other order of bytes.
#[test]
fn big_endian_numbers_are_read() {
    let mut bytes = vec![b' '; 124];
    bytes.extend(b"\x01\x00MI");
    let word = |x: u32| x.to_be_bytes();
    let mut matrix = Vec::new();
    for (kind, data) in [
        (6_u32, [word(6), word(0)].concat()),
        (5, [word(1), word(2)].concat()),
        (1, b"x\0\0\0\0\0\0\0".to_vec()),
        (9, [2.5_f64.to_be_bytes(), (-1e9_f64).to_be_bytes()].concat()),
    ] {
        let size = if kind == 1 { 1 } else { data.len() as u32 };
        matrix.extend([word(kind), word(size)].concat());
        matrix.extend(data);
    }
    bytes.extend([word(14), word(matrix.len() as u32)].concat());
    bytes.extend(matrix);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("big.mat");
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(open(&path).unwrap().array("x").unwrap().values, [2.5, -1e9]);
}

#[test]
fn a_structure_of_version_7_3_has_its_fields() {
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/samples");
    let [plain, packed, newer] = ["records_plain.mat", "records.mat", "records_73.mat"]
        .map(|name| open(&samples.join(name)).unwrap());
    assert_eq!(newer.names(), ["record.strain", "record.t"]);
    for name in newer.names() {
        let right = plain.array(name).unwrap();
        assert_eq!(newer.array(name).unwrap(), right);
        assert_eq!(packed.array(name).unwrap(), right);
    }
}

#[test]
fn files_of_level_4_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("old.mat");
    std::fs::write(&path, [0; 300]).unwrap();
    let error = open(&path).err().unwrap().to_string();
    assert!(error.contains("is not a MAT-file of level 5 or version 7.3"), "{error}");
}
