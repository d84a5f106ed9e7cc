//! Linear forward maps, which cross the boundary both ways: to a discrepancy, and from an emulator.

mod serve;
mod view;

pub use serve::ServedLinear;
pub use view::LinearView;
