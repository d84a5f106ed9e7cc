//! Coverage of printed uncertainties: `lacuna coverage`, and the gate.

pub mod verb;
