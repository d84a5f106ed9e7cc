//! Tables of runs and measurements.

use lacuna::data::Parameter;
use lacuna::math::distribution::Distribution;
use lacuna::plugin::Reader;
use lacuna::plugin::reader::{EnsembleSource, GridSource, MeasurementSource};
use lacuna::plugin::registry::from_text;

use super::shared::{LONGEST, as_file, is_told, layout, unit};
// Without this line the linker leaves the plugins out.
use lacuna_plugins as _;

/// Options under which the one file is every table that a study can name.
const OPTIONS: [&str; 4] = [
    "path = \"data.csv\"",
    "path = \"data.csv\"\nmask = \"data.csv\"\nignore = [\"note\"]",
    "path = \"data.csv\"\ncovariance = \"data.csv\"\ngroups = \"target\"",
    "parameters = \"data.csv\"\nresponses = \"data.csv\"\nallow_failed = 0.5",
];

/// Checks that a table that is read has the shape of the response, and that a fault is told with the file.
pub fn csv(bytes: &[u8]) {
    if bytes.len() > LONGEST {
        return;
    }
    as_file("data.csv", bytes, |path| {
        let directory = path.parent().expect("a folder");
        let layout = layout();
        let uniform = Distribution::Uniform([0.0, 10.0]);
        let parameters =
            ["frequency", "damping"].map(|name| Parameter::plain(name, uniform.clone()));
        for options in OPTIONS {
            let reader = from_text::<dyn Reader>("csv", options).expect("options").plugin;
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
            let source = EnsembleSource {
                directory,
                simulated: None,
                parameters: &parameters,
                scenario: None,
                layout: &layout,
            };
            match reader.ensemble(&source) {
                Ok(found) => {
                    assert_eq!(found.responses.rows(), found.points.rows());
                    assert!(found.responses.as_slice().iter().all(|x| x.is_finite()));
                    assert!(found.points.as_slice().iter().all(|x| x.is_finite()));
                }
                Err(error) => is_told(&error, path),
            }
            let source = GridSource { directory, scenario: None, axis: "time", unit: &unit("s") };
            match reader.grid(&source) {
                Ok(grid) => assert!(grid.is_sorted_by(|a, b| a < b), "{grid:?}"),
                Err(error) => is_told(&error, path),
            }
            if let Err(error) = reader.groups(directory) {
                is_told(&error, path);
            }
        }
    });
}
