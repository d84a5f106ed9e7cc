//! Files written by the netCDF C library through Python's netCDF4, in variants that no sample has.

use std::process::Command;

use super::super::exodus::{Exodus, Kind};
use super::super::parts::Results;
use super::super::probe::Probe;

/// Two elements with single-precision values, 64-bit ids and, in netCDF-4, deflated chunks.
const WRITE: &str = r#"
import sys, netCDF4, numpy as np
path, model = sys.argv[1:]
d = netCDF4.Dataset(path, "w", format=model)
packed = dict(zlib=True, shuffle=True, fletcher32=True) if model.startswith("NETCDF4") else {}
integer = "i8" if model in ("NETCDF4", "NETCDF3_64BIT_DATA") else "i4"
d.api_version = np.float32(9.06); d.floating_point_word_size = np.int32(4)
d.last_written_time = 0.3
for name, size in dict(time_step=None, num_nodes=4, num_dim=2, num_elem=2, num_el_blk=1, len_name=33,
                       num_el_in_blk1=2, num_nod_per_el1=3, num_elem_var=1, num_glo_var=2).items():
    d.createDimension(name, size)
def put(name, kind, dims, values, **options):
    v = d.createVariable(name, kind, dims, **options); v.set_auto_chartostring(False); v[:] = values
def names(*texts):
    return np.array([list(t.ljust(33, "\0").encode()) for t in texts], "u1").view("S1")
put("coordx", "f4", ("num_nodes",), [0, 1, 1, 0], **packed)
put("coordy", "f4", ("num_nodes",), [0, 0, 1, 1], **packed)
put("elem_num_map", integer, ("num_elem",), [5000000000 if integer == "i8" else 50, 7], **packed)
put("eb_prop1", integer, ("num_el_blk",), [1])
put("connect1", integer, ("num_el_in_blk1", "num_nod_per_el1"), [[1, 2, 3], [1, 3, 4]])
put("name_elem_var", "S1", ("num_elem_var", "len_name"), names("strain_xx"))
put("name_glo_var", "S1", ("num_glo_var", "len_name"), names("energy", "step"))
t = np.arange(200, dtype="f8")
put("time_whole", "f4", ("time_step",), 0.1 * t[:5])
put("vals_elem_var1eb1", "f4", ("time_step", "num_el_in_blk1"), np.stack([t, t * t], 1)[:5], **packed)
put("vals_glo_var", "f4", ("time_step", "num_glo_var"), np.stack([-t, t + 0.5], 1)[:5], **packed)
d.createVariable("vals_nod_var1", "f8", ("time_step", "num_nodes"))[:2] = 1.0
put("name_nod_var", "S1", ("num_glo_var", "len_name"), names("late", "never"))
d.close()
"#;

#[test]
fn every_container_of_the_c_library_is_read() {
    let Ok(python) = std::env::var("LACUNA_PYTHON") else {
        println!("skipped: LACUNA_PYTHON names no interpreter that has netCDF4");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let models = [
        "NETCDF3_CLASSIC",
        "NETCDF3_64BIT_OFFSET",
        "NETCDF3_64BIT_DATA",
        "NETCDF4",
        "NETCDF4_CLASSIC",
    ];
    for model in models {
        let path = folder.path().join("run.e");
        let status = Command::new(&python).args(["-c", WRITE]).arg(&path).arg(model).status();
        assert!(status.unwrap().success(), "{model}");
        let file = Exodus::open(&path).unwrap();
        // The time 0.3 is in single precision, slightly above the 0.3 of double precision.
        assert_eq!((file.times.len(), file.incomplete_steps), (4, 1), "{model}");
        let first = file.ids(Kind::Element).unwrap()[0];
        assert!([50, 5_000_000_000].contains(&first), "{model}");
        let results = Results::single(file);
        let read = |name: &str, probe: Probe| results.series(name, &probe).unwrap().1;
        let probe = || Probe::named("");
        assert_eq!(read("energy", probe()), [0.0, -1.0, -2.0, -3.0]);
        assert_eq!(read("step", probe()), [0.5, 1.5, 2.5, 3.5]);
        assert_eq!(read("strain_xx", Probe { id: Some(7), ..probe() }), [0.0, 1.0, 4.0, 9.0]);
        assert_eq!(read("strain_xx", Probe { id: Some(first), ..probe() }), [0.0, 1.0, 2.0, 3.0]);
        // Steps that were never written hold the library's fill value.
        let late = read("late", Probe { id: Some(2), ..probe() });
        assert!(late[..2] == [1.0, 1.0] && late[2].is_nan() && late[3].is_nan());
        assert!(results.series("never", &Probe { id: Some(2), ..probe() }).is_err());
        let corner = Probe { nearest: Some([0.0, 1.0, 0.0]), ..probe() };
        assert_eq!(read("strain_xx", corner), [0.0, 1.0, 4.0, 9.0]);
    }
}
