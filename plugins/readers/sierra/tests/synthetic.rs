//! Features that no sample file has, in Exodus files made here according to `exodusII_int.h`.

use std::path::{Path, PathBuf};

use netcdf_writer::{DimensionId, NcAttrValue, NcFileBuilder, NcWriteOptions};

use super::super::exodus::{Exodus, Kind};
use super::super::parts::Results;
use super::super::probe::{GroupName, Probe};

/// Two square elements side by side in the plane, each a block, over three steps, the last of which was not finished.
struct Mesh {
    old_coordinates: bool,
    element_ids: [i32; 2],
    shift: f64,
}

impl Mesh {
    fn write(&self, path: &Path) {
        let mut file = NcFileBuilder::new();
        file.add_attribute("api_version", NcAttrValue::Floats(vec![4.0])).unwrap();
        file.add_attribute("last_written_time", NcAttrValue::Doubles(vec![0.1])).unwrap();
        file.add_attribute("floating_point_word_size", NcAttrValue::Ints(vec![4])).unwrap();
        let step = file.add_unlimited_dimension("time_step").unwrap();
        let time = file.add_variable::<f32>("time_whole", &[step]).unwrap();
        file.write_variable(time, &[0.0f32, 0.1, 0.2]).unwrap();
        let nodes = file.add_dimension("num_nodes", 6).unwrap();
        self.coordinates(&mut file, nodes);
        let length = file.add_dimension("len_string", 33).unwrap();
        integers(&mut file, "node_num_map", nodes, &[11, 12, 13, 14, 15, 16]);
        let elements = file.add_dimension("num_elem", 2).unwrap();
        integers(&mut file, "elem_num_map", elements, &self.element_ids);
        let blocks = file.add_dimension("num_el_blk", 2).unwrap();
        integers(&mut file, "eb_prop1", blocks, &[100, 200]);
        let corners = file.add_dimension("num_nod_per_el1", 4).unwrap();
        for (b, connect) in [(1, [1, 2, 5, 4]), (2, [2, 3, 6, 5])] {
            let one = file.add_dimension(format!("num_el_in_blk{b}"), 1).unwrap();
            let v = file.add_variable::<i32>(format!("connect{b}"), &[one, corners]).unwrap();
            file.write_variable(v, &connect).unwrap();
        }
        // One nodal variable, with all of them in one netCDF variable as in files of the 1990s.
        names(&mut file, "nod", length, &["velocity"]);
        let count = file.add_dimension("nodal", 1).unwrap();
        let v = file.add_variable::<f32>("vals_nod_var", &[step, count, nodes]).unwrap();
        let numbers: Vec<f32> = (0..18).map(|i| i as f32).collect();
        file.write_variable(v, &numbers).unwrap();
        Self::sets(&mut file, step, length);
        let (_, bytes) = file.to_vec(NcWriteOptions::classic()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }

    fn coordinates(&self, file: &mut NcFileBuilder, nodes: DimensionId) {
        let x: Vec<f64> = [0.0, 1.0, 2.0, 0.0, 1.0, 2.0].iter().map(|x| x + self.shift).collect();
        let y = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let axes = file.add_dimension("num_dim", 2).unwrap();
        if self.old_coordinates {
            let v = file.add_variable::<f64>("coord", &[axes, nodes]).unwrap();
            file.write_variable(v, &[&x[..], &y[..]].concat()).unwrap();
        } else {
            for (name, values) in [("coordx", &x[..]), ("coordy", &y[..])] {
                let v = file.add_variable::<f64>(name, &[nodes]).unwrap();
                file.write_variable(v, values).unwrap();
            }
        }
    }

    /// A variable of the second block only, one of a node set and one of a side set.
    fn sets(file: &mut NcFileBuilder, step: DimensionId, length: DimensionId) {
        let two = file.add_dimension("two", 2).unwrap();
        names(file, "elem", length, &["heat", "damage"]);
        let blocks = file.add_dimension("table_rows", 2).unwrap();
        let table = file.add_variable::<i32>("elem_var_tab", &[blocks, two]).unwrap();
        file.write_variable(table, &[1, 0, 1, 1]).unwrap();
        for (name, values) in [
            ("vals_elem_var1eb1", [1.0, 2.0, 3.0]),
            ("vals_elem_var1eb2", [4.0, 5.0, 6.0]),
            ("vals_elem_var2eb2", [7.0, 8.0, 9.0]),
        ] {
            let one = file.add_dimension(format!("one_{name}"), 1).unwrap();
            let v = file.add_variable::<f64>(name, &[step, one]).unwrap();
            file.write_variable(v, &values).unwrap();
        }
        let one = file.add_dimension("num_node_sets", 1).unwrap();
        integers(file, "ns_prop1", one, &[7]);
        integers(file, "node_ns1", two, &[3, 6]);
        names(file, "nset", length, &["reaction"]);
        let v = file.add_variable::<f64>("vals_nset_var1ns1", &[step, two]).unwrap();
        file.write_variable(v, &[1.0, -1.0, 2.0, -2.0, 3.0, -3.0]).unwrap();
        integers(file, "ss_prop1", one, &[9]);
        integers(file, "elem_ss1", two, &[2, 2]);
        integers(file, "side_ss1", two, &[1, 3]);
        names(file, "sset", length, &["traction"]);
        let v = file.add_variable::<f64>("vals_sset_var1ss1", &[step, two]).unwrap();
        file.write_variable(v, &[10.0, 20.0, 11.0, 21.0, 12.0, 22.0]).unwrap();
    }
}

fn integers(file: &mut NcFileBuilder, name: &str, dimension: DimensionId, values: &[i32]) {
    let v = file.add_variable::<i32>(name, &[dimension]).unwrap();
    file.write_variable(v, values).unwrap();
}

fn names(file: &mut NcFileBuilder, kind: &str, length: DimensionId, names: &[&str]) {
    let count = file.add_dimension(format!("num_{kind}_var"), names.len() as u64).unwrap();
    let v = file.add_char_variable(format!("name_{kind}_var"), &[count, length]).unwrap();
    // Fortran writers pad with blanks.
    let bytes: Vec<u8> = names.iter().flat_map(|n| format!("{n:<33}").into_bytes()).collect();
    file.write_char_variable(v, &bytes).unwrap();
}

fn written(folder: &tempfile::TempDir, name: &str, mesh: &Mesh) -> PathBuf {
    let path = folder.path().join(name);
    mesh.write(&path);
    path
}

#[test]
fn both_coordinate_layouts_and_every_kind_of_variable() {
    let folder = tempfile::tempdir().unwrap();
    for old_coordinates in [true, false] {
        let mesh = Mesh { old_coordinates, element_ids: [31, 32], shift: 0.0 };
        let path = written(&folder, "mesh.e", &mesh);
        let results = Results::open(&path).unwrap();
        // The last step came after `last_written_time`.
        assert_eq!(results.parts()[0].incomplete_steps, 1);
        let read = |name: &str, probe: Probe| results.series(name, &probe).unwrap().1;
        let bare = || Probe::named("");
        let by_id = |id| Probe { id: Some(id), ..bare() };
        let near = |point| Probe { nearest: Some(point), ..bare() };
        assert_eq!(read("velocity", by_id(13)), [2.0, 8.0]);
        assert_eq!(read("Velocity", near([0.9, 1.2, 5.0])), [4.0, 10.0]);
        assert_eq!(read("heat", by_id(31)), [1.0, 2.0]);
        assert_eq!(read("heat", near([1.6, 0.5, 0.0])), [4.0, 5.0]);
        let block = |block| Probe { block: Some(block), ..bare() };
        assert_eq!(read("heat", block(GroupName::Id(200))), [4.0, 5.0]);
        assert_eq!(read("damage", bare()), [7.0, 8.0]);
        // The nearest element that has the variable.
        assert_eq!(read("damage", near([0.0; 3])), [7.0, 8.0]);
        assert_eq!(read("reaction", by_id(16)), [-1.0, -2.0]);
        let side = Probe { side: Some(3), ..by_id(32) };
        assert_eq!(read("traction", side), [20.0, 21.0]);
        let several = results.series("traction", &by_id(32)).unwrap_err().message;
        assert!(several.contains("give `side`, one of `1`, `3`"), "{several}");
        let absent = results.series("damage", &by_id(31)).unwrap_err().message;
        assert!(absent.contains("does not exist on `100`"), "{absent}");
        let unknown = results.series("heat", &block(GroupName::Id(3))).unwrap_err().message;
        assert!(unknown.contains("no element block `3`; it has `100`, `200`"), "{unknown}");
    }
}

#[test]
fn the_nearest_entity_of_all_parts_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let part = |shift, element_ids| Mesh { old_coordinates: false, element_ids, shift };
    written(&folder, "run.e.2.0", &part(0.0, [1, 2]));
    let path = written(&folder, "run.e.2.1", &part(2.0, [3, 4]));
    let results = Results::open(&folder.path().join("run.e")).unwrap();
    assert_eq!(results.parts().len(), 2);
    let probe = Probe { nearest: Some([3.6, 0.5, 0.0]), ..Probe::named("heat") };
    assert_eq!(results.series("heat", &probe).unwrap().1, [4.0, 5.0]);
    let probe = Probe { id: Some(3), ..Probe::named("heat") };
    assert_eq!(results.series("heat", &probe).unwrap().1, [1.0, 2.0]);
    assert_eq!(Exodus::open(&path).unwrap().ids(Kind::Element).unwrap(), [3, 4]);
}
