//! Sierra's Exodus files: netCDF classic, with 64-bit offsets or data, and netCDF-4.

use lacuna::plugin::Reader;
use lacuna::plugin::registry::from_text;
use lacuna_plugins as _;

use super::shared::{LONGEST, as_file, is_told, layout};

/// Options with a gauge in the mesh and one by its name alone.
const OPTIONS: [&str; 2] = [
    "variable = \"displacement\"",
    "unit = \"mm\"\nsensors.a = { variable = \"disp_x\", nearest = [0.0, 0.0, 0.0] }\n\
     sensors.b = { variable = \"log_strain\", direction = [1.0, 0.0, 0.0], id = 1 }",
];

/// A damaged file is told with its name and takes no memory that its size does not justify.
pub fn exodus(bytes: &[u8]) {
    if bytes.len() > LONGEST {
        return;
    }
    as_file("run.e", bytes, |path| {
        for options in OPTIONS {
            let reader = from_text::<dyn Reader>("sierra", options).expect("options").plugin;
            reader.recognises(path, &bytes[..bytes.len().min(4096)]);
            match reader.inspect(path) {
                Ok(contents) => assert!(!contents.format.is_empty()),
                Err(error) => is_told(&error, path),
            }
            match reader.response(path, &layout()) {
                Ok(values) => assert_eq!(values.len(), layout().len()),
                Err(error) => is_told(&error, path),
            }
        }
    });
}
