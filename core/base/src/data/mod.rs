//! Plain data that stages pass to each other: layouts with named axes and units, runs, replicates, tables.

pub mod draws;
pub mod ensemble;
pub mod field;
pub mod layout;
pub mod layouts;
pub mod measurements;
pub mod parameter;
pub mod population;
pub mod prior;
pub mod scenario;
pub mod shared;
pub mod statistics;
pub mod table;
pub mod unit;

pub use draws::Draws;
pub use ensemble::{Ensemble, FailedRun};
pub use field::Field;
pub use layout::{Axis, Coordinates, Layout};
pub use layouts::Layouts;
pub use measurements::{Measurements, Observations, Replicate};
pub use parameter::Parameter;
pub use population::{Form, Population};
pub use prior::{Constraint, Dependence, Group, JointPrior, Share};
pub use scenario::{Condition, Function, Interpolation, Scenario};
pub use shared::Shared;
pub use statistics::{Statistic, Statistics};
pub use table::Table;
pub use unit::{Unit, UnitError};
