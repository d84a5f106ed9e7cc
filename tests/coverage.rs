//! Coverage of printed uncertainties: `lacuna coverage`, and the gate.

mod elsewhere;
pub mod verb;
