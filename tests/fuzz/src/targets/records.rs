//! Measured records: netCDF, HDF5, MAT and TDMS files.

use lacuna::plugin::Reader;
use lacuna::plugin::reader::{GridSource, MeasurementSource};
use lacuna::plugin::registry::from_text;
use lacuna_plugins as _;

use super::shared::{LONGEST, as_file, is_told, layout, unit};

/// The readers of files of named arrays, with options of each.
const READERS: [(&str, &str); 7] = [
    ("netcdf", "path = \"shots.dat\""),
    ("hdf5", "path = \"shots.dat\"\ndataset = \"displacement\"\naxes = [\"time\"]\nstep = 0.05"),
    (
        "hdf5",
        "path = \"shots.dat\"\ndataset = \"shot_{replicate}/strain\"\naxes = [\"time\"]\ntime = \"shot_{replicate}/time\"",
    ),
    (
        "matlab",
        "path = \"shots.dat\"\ndataset = \"displacement\"\naxes = [\"time\", \"replicate\"]\nstep = 0.05",
    ),
    (
        "matlab",
        "path = \"shots.dat\"\ndataset = \"pulse({replicate}).strain\"\naxes = [\"time\"]\ntime = \"pulse({replicate}).t\"",
    ),
    ("tdms", "path = \"shots.dat\"\ndataset = \"strain/{replicate}\"\nresample = \"linear\""),
    ("tdms", "path = \"shots.dat\"\ndataset = \"types/float64\"\nstep = 0.05\ntime_unit = \"s\""),
];

/// Checks that a record that is read has the shape of the response, and that a damaged one is told with the file.
pub fn records(bytes: &[u8]) {
    if bytes.len() > LONGEST {
        return;
    }
    as_file("shots.dat", bytes, |path| {
        let directory = path.parent().expect("a folder");
        let layout = layout();
        for (name, options) in READERS {
            let reader = from_text::<dyn Reader>(name, options).expect("options").plugin;
            if !reader.recognises(path, &bytes[..bytes.len().min(4096)]) {
                continue;
            }
            match reader.inspect(path) {
                Ok(contents) => assert!(!contents.format.is_empty()),
                Err(error) => is_told(&error, path),
            }
            let source = MeasurementSource { directory, scenario: None, layout: &layout };
            match reader.measurements(&source) {
                Ok(found) => {
                    for replicate in &found.replicates {
                        assert_eq!(replicate.values.len(), layout.len());
                        assert!(replicate.values.iter().flatten().all(|x| x.is_finite()));
                    }
                }
                Err(error) => is_told(&error, path),
            }
            let source = GridSource { directory, scenario: None, axis: "time", unit: &unit("s") };
            if let Err(error) = reader.grid(&source) {
                is_told(&error, path);
            }
        }
    });
}
