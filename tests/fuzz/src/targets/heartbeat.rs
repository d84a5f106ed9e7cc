//! Sierra's heartbeat files.

use std::path::Path;

use lacuna_plugins::readers::sierra::heartbeat::Heartbeat;

use super::shared::{LONGEST, is_told};

/// All columns of what is read are of one length, and times increase.
pub fn heartbeat(bytes: &[u8]) {
    if bytes.len() > LONGEST {
        return;
    }
    let path = Path::new("folder/heartbeat.txt");
    match Heartbeat::parse(path, bytes) {
        Ok(read) => {
            assert_eq!(read.names.len(), read.columns.len());
            let length = read.columns.first().map_or(0, Vec::len);
            assert!(read.columns.iter().all(|column| column.len() == length));
            if let Some(time) = read.time {
                assert!(time < read.columns.len());
            }
        }
        Err(error) => is_told(&error, path),
    }
}
