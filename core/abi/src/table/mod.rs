//! The plain structs and tables of functions that cross the boundary, laid out as C does.
//!
//! The C header is made from these declarations (`super::header`), so that this folder alone defines the boundary.
//! Rules that hold for all of it:
//!
//! - Who allocates frees. Results go into buffers of the caller, or through an [`Answer`] of the caller.
//! - What a call is given belongs to the caller and is there until the call returns.
//! - A function never unwinds into its caller.
//! - Tables and structs begin with their size, so that a later minor version can append to them.
//! - Objects may be used from several threads at once, unless it is said otherwise.

#[macro_use]
mod functions;
mod component;
mod declaration;
mod design;
mod discrepancy;
mod effect;
mod linear;
mod model;
mod quantity;
mod reader;
mod sampler;
mod surrogate;

pub use crate::basic::{Answer, Key, Numbers, Text};
pub use crate::shape::{Field, Shape, Table, Type, copied, read, whole};
pub use component::ComponentFunctions;
pub use declaration::{Declaration, Entry, Host, MAGIC, MAJOR, MINOR};
pub use design::{DesignFunctions, ServeDesign};
pub use discrepancy::{
    CommonErrorView, Compressed, CompressedFunctions, DiscrepancyFunctions, Known, KnownFunctions,
    Likelihood, LikelihoodFunctions, ServeCompressed, ServeDiscrepancy, ServeKnown,
    ServeLikelihood,
};
pub use effect::{EffectFunctions, ServeEffect};
pub use linear::{Linear, LinearFunctions, ServeLinear, ServeSquares, Squares, SquaresFunctions};
pub use model::{Calls, ModelFunctions, ServeModel};
pub use quantity::{
    Functional, FunctionalFunctions, QuantityFunctions, ServeFunctional, ServeQuantity,
};
pub use reader::{ReaderFunctions, ServeReader};
pub use sampler::{
    Plan, SamplerFunctions, ServeSampler, ServeTarget, State, Target, TargetFunctions,
};
pub use surrogate::{
    Emulator, EmulatorFunctions, Progress, ProgressFunctions, ServeEmulator, ServeProgress,
    ServeSurrogate, Summand, SurrogateFunctions, Training,
};

/// Everything that crosses the boundary, in the order in which C must see it.
pub fn shapes() -> Vec<Shape> {
    vec![
        Text::SHAPE,
        Numbers::SHAPE,
        Key::SHAPE,
        Answer::SHAPE,
        ComponentFunctions::SHAPE,
        SquaresFunctions::SHAPE,
        Squares::SHAPE,
        LinearFunctions::SHAPE,
        Linear::SHAPE,
        CommonErrorView::SHAPE,
        KnownFunctions::SHAPE,
        Known::SHAPE,
        CompressedFunctions::SHAPE,
        Compressed::SHAPE,
        LikelihoodFunctions::SHAPE,
        Likelihood::SHAPE,
        DiscrepancyFunctions::SHAPE,
        TargetFunctions::SHAPE,
        Target::SHAPE,
        Plan::SHAPE,
        State::SHAPE,
        SamplerFunctions::SHAPE,
        DesignFunctions::SHAPE,
        Calls::SHAPE,
        ModelFunctions::SHAPE,
        EffectFunctions::SHAPE,
        ReaderFunctions::SHAPE,
        ProgressFunctions::SHAPE,
        Progress::SHAPE,
        Training::SHAPE,
        EmulatorFunctions::SHAPE,
        Emulator::SHAPE,
        Summand::SHAPE,
        SurrogateFunctions::SHAPE,
        FunctionalFunctions::SHAPE,
        Functional::SHAPE,
        QuantityFunctions::SHAPE,
        Host::SHAPE,
        Entry::SHAPE,
        Declaration::SHAPE,
    ]
}
