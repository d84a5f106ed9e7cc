//! Exodus files of the real libraries. Numbers were read from the same files with the Python package netCDF4 1.7,
//! which uses the C library.

use super::super::exodus::{Exodus, Kind};
use super::super::parts::Results;
use super::super::probe::{GroupName, Probe};
use super::super::signal::Output;
use super::{base, largest_difference, reference, sample};

#[test]
fn all_containers_hold_the_same_history() {
    let (names, times, values) = base();
    for file in ["hist_cdf2.h", "hist_cdf5.h", "hist_nc4.h"] {
        let output = Output::open(&sample(file)).unwrap();
        for (name, expected) in names.iter().zip(&values) {
            let signal = output.signal(&Probe::named(format!("STRAIN_{name}"))).unwrap();
            assert!(largest_difference(&signal.times, &times) < 1e-12, "{file}");
            // base.csv has three decimals of a microstrain.
            assert!(largest_difference(&signal.values, expected) < 1e-15, "{file} {name}");
        }
    }
}

#[test]
fn a_direction_picks_the_normal_component_of_a_tensor() {
    let (_, _, values) = base();
    let output = Output::open(&sample("hist_nc4.h")).unwrap();
    let tensor = |direction| Probe { direction: Some(direction), ..Probe::named("log_strain_B") };
    let along = |direction| output.signal(&tensor(direction)).unwrap().values;
    assert!(largest_difference(&along([2.0, 0.0, 0.0]), &values[0]) < 1e-15);
    // The sample's components are B, 0.2 B, -0.3 B and the shears 1e-9, 2e-9, 3e-9.
    let expected: Vec<f64> = values[0].iter().map(|b| 0.6 * b + 1e-9).collect();
    assert!(largest_difference(&along([1.0, 1.0, 0.0]), &expected) < 1e-15);
    let expected: Vec<f64> =
        values[0].iter().map(|b| (0.9 * b + 2.0 * (1e-9 + 2e-9 + 3e-9)) / 3.0).collect();
    assert!(largest_difference(&along([-1.0, -1.0, -1.0]), &expected) < 1e-15);
    assert!(output.signal(&tensor([0.0; 3])).is_err());
}

#[test]
fn a_sierra_results_file_gives_values_by_id_and_by_place() {
    let Some(path) = reference("real/seacas_block_crush_1.ex2") else { return };
    let output = Output::open(&path).unwrap();
    let at = |probe: &Probe| output.signal(probe).unwrap().values;
    let energy = at(&Probe::named("kineticenergy"));
    assert_eq!((energy.len(), energy[5]), (11, 333.166_940_733_118_34));

    let node = Probe { id: Some(101), ..Probe::named("displ_y") };
    let near = Probe { nearest: Some([0.01, 0.49, 0.51]), ..Probe::named("displ_y") };
    assert_eq!(at(&node)[10], 0.000_432_535_453_471_599);
    assert_eq!(at(&near), at(&node));

    let element = Probe { id: Some(81), ..Probe::named("stress_xx") };
    let near = Probe { nearest: Some([0.62, -0.12, -0.13]), ..Probe::named("stress_xx") };
    assert_eq!(at(&element)[1], -30_413.428_418_187_406);
    assert_eq!(at(&near), at(&element));

    let absent = Probe { id: Some(132), ..Probe::named("vonmises") };
    let message = output.signal(&absent).unwrap_err().message;
    assert!(message.contains("does not exist on `RigidBodyOutputPart`"), "{message}");
    let alone = Probe {
        block: Some(GroupName::Name("rigidbodyoutputpart".into())),
        ..Probe::named("processor_id")
    };
    assert_eq!(at(&alone), [1.0; 11]);
    let message = output.signal(&Probe::named("vonmises")).unwrap_err().message;
    assert!(message.contains("131 elements: give `id` or `nearest`"), "{message}");
    let message = output.signal(&Probe::named("strain")).unwrap_err().message;
    assert!(message.contains("no variable `strain`; it has `ExternalEnergy`"), "{message}");
}

#[test]
fn old_and_foreign_files_open() {
    let series = |file: &str, name: &str| {
        let results = Results::open(&reference(file)?).unwrap();
        Some(results.series(name, &Probe::named(name)).unwrap())
    };
    // ALEGRA: names in `len_string`, before `len_name` existed.
    if let Some((times, values)) = series("real/exodusii_noh.exo", "DT_ELASTIC") {
        assert_eq!((times.len(), times[2], values[30]), (31, 0.00396, 0.896_309_820_704_414_1));
    }
    // CDF-1.
    if let Some((times, values)) = series("real/seacas_exodus.g", "Region_2") {
        assert_eq!((times[6], values[2]), (6.0, 1_457_850_878.0));
    }
    // Written by Peridigm: a history of one sphere.
    let peridigm = "real/peridigm_MultipleOutputFiles2_gold.h";
    if let Some((times, values)) = series(peridigm, "Global_Kinetic_Energy") {
        assert_eq!((times.len(), times[1], values[100]), (101, 1e-5, 14_136.862_847_823_988));
    }
    if let Some(path) = reference("real/seacas_test-assembly.exo") {
        let file = Exodus::open(&path).unwrap();
        assert_eq!((file.blocks.len(), file.times.len(), file.elements()), (7, 10, 7));
    }
}

#[test]
fn parts_of_a_parallel_run_are_searched_for_the_entity() {
    let Some(path) = reference("real/lcm_cuboid_01.gold.e.4.0") else { return };
    for name in [path.clone(), path.with_file_name("lcm_cuboid_01.gold.e")] {
        let results = Results::open(&name).unwrap();
        assert_eq!(results.parts().len(), 2);
        // Element 7 lies in part 1, element 10 in part 0; 1 and 16 in parts that are missing.
        for id in [7, 10] {
            let probe = Probe { id: Some(id), ..Probe::named("Cauchy_Stress_1_1") };
            results.series("Cauchy_Stress_1_1", &probe).unwrap();
        }
        let probe = Probe { id: Some(1), ..Probe::named("Cauchy_Stress_1_1") };
        let message = results.series("Cauchy_Stress_1_1", &probe).unwrap_err().message;
        assert!(message.contains("2 of the run's 4 files are missing"), "{message}");
        let probe = Probe { nearest: Some([0.0; 3]), ..Probe::named("disp_x") };
        let message = results.series("disp_x", &probe).unwrap_err().message;
        assert!(message.contains("nearest node is unknown"), "{message}");
    }
}

#[test]
fn kinds_are_listed_as_the_file_has_them() {
    let file = Exodus::open(&sample("hist_nc4.h")).unwrap();
    assert_eq!(file.names(Kind::Global).len(), 21);
    assert_eq!((file.nodes, file.elements(), file.blocks[0].name.as_str()), (1, 1, "e1"));
    assert_eq!(file.container.text("title").as_deref(), Some("IOSS Default Output Title"));
    assert_eq!(file.incomplete_steps, 0);
}
