//! The bodies of the fuzz targets, as a library. The tests include the same module, so that its corpus holds there too.

pub mod targets;
