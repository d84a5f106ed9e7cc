//! The gauges of the target: code shared by the programs that make measured strain.

/// Name of each gauge and standard deviation of its noise in microstrain, as in `configs/sns`.
pub const GAUGES: [(&str, f64); 10] = [
    ("B", 16.0),
    ("C", 26.0),
    ("G", 7.0),
    ("M", 6.0),
    ("R", 14.0),
    ("T", 15.0),
    ("U", 28.0),
    ("V", 13.0),
    ("Y", 14.0),
    ("Z", 12.0),
];
