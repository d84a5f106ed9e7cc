//! Truth: what was computed elsewhere comes out here too.

mod posteriordb;
