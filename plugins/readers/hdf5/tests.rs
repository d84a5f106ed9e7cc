//! Files written by h5py.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use lacuna::plugin::Reader;

use super::Hdf5;
use super::file::File;
use crate::readers::netcdf::NetCdf;
use crate::readers::records::store::Store as _;

/// Numbers of many types, both byte orders, all layouts of storage, and the forms of attributes.
const WRITE: &str = r#"
import sys, h5py, numpy as np
with h5py.File(sys.argv[1], "w", libver=sys.argv[2]) as f:
    x = np.arange(12).reshape(3, 4)
    for kind in ["<f4", ">f4", "<f8", ">f8", "i1", "u1", "<i2", ">i2", "<u4", ">i8"]:
        f.create_dataset("types/" + kind.replace("<", "l").replace(">", "b"), data=x.astype(kind))
    f.create_dataset("packed", data=x, chunks=(2, 3), compression="gzip", shuffle=True, fletcher32=True)
    d = f.create_dataset("scaled", data=x.astype("i2"))
    d.attrs["scale_factor"], d.attrs["add_offset"], d.attrs["_FillValue"] = 0.5, 1.0, np.int16(5)
    d.attrs["units"] = "mm"
    f["fixed"] = x[0]
    f["fixed"].attrs["unit"] = np.bytes_("m/s")
    f["text"] = "hello"
    f["flags"] = np.array([True, False])
    f["number"] = 3.5
    f["circle/back"] = f["/"]
"#;

fn python(script: &str, arguments: &[&str]) -> bool {
    let Ok(python) = std::env::var("LACUNA_PYTHON") else {
        println!("skipped: LACUNA_PYTHON names no interpreter that has h5py");
        return false;
    };
    let has = Command::new(&python).args(["-c", "import h5py"]).output().unwrap();
    if !has.status.success() {
        println!("skipped: {python} does not have h5py");
        return false;
    }
    let output = Command::new(&python).args(["-c", script]).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    true
}

#[test]
fn numbers_of_h5py_are_read() {
    let folder = tempfile::tempdir().unwrap();
    for version in ["earliest", "latest"] {
        let path = folder.path().join("written.h5");
        if !python(WRITE, &[path.to_str().unwrap(), version]) {
            return;
        }
        let file = File::open(&path).unwrap();
        let right: Vec<f64> = (0..12).map(f64::from).collect();
        let types: Vec<&String> = file.names().iter().filter(|n| n.starts_with("types/")).collect();
        assert_eq!(types.len(), 10);
        for name in types.into_iter().chain([&"packed".to_owned()]) {
            let array = file.array(name).unwrap();
            assert_eq!(
                (&array.shape[..], &array.values),
                (&[3, 4][..], &right),
                "{version} {name}"
            );
        }
        let scaled = file.array("scaled").unwrap();
        assert_eq!(scaled.unit.as_deref(), Some("mm"));
        for (i, x) in scaled.values.iter().enumerate() {
            assert!(if i == 5 { x.is_nan() } else { *x == 0.5 * i as f64 + 1.0 }, "{i} {x}");
        }
        assert_eq!(file.array("fixed").unwrap().unit.as_deref(), Some("m/s"));
        assert_eq!(file.array("number").unwrap().values, [3.5]);
        for name in ["text", "flags"] {
            let error = file.array(name).unwrap_err().to_string();
            assert!(error.contains("does not hold numbers") && error.contains(name), "{error}");
        }
        let contents = Hdf5::default().inspect(&path).unwrap();
        assert_eq!((contents.variables.len(), contents.facts.len()), (14, 2));
    }
}

#[test]
fn files_of_netcdf_are_left_to_their_reader() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.nc");
    let script = "import sys, netCDF4\nd = netCDF4.Dataset(sys.argv[1], 'w')\nd.createDimension('t', 2)\n\
                  d.createVariable('t', 'f8', ('t',))[:] = [1, 2]\nd.close()";
    if python(script, &[path.to_str().unwrap()]) {
        let head = std::fs::read(&path).unwrap();
        let head = &head[..head.len().min(4096)];
        assert!(!Hdf5::default().recognises(&path, head));
        assert!(NetCdf::default().recognises(&path, head));
    }
    let samples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/samples");
    for (name, own) in [("records.h5", true), ("hist_nc4.h", false)] {
        let path = samples.join(name);
        let head = std::fs::read(&path).unwrap();
        let head = &head[..head.len().min(4096)];
        assert_eq!(Hdf5::default().recognises(&path, head), own, "{name}");
    }
}
