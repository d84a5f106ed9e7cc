//! Both sides of the boundary in one process: what the program asks of the functions that a library gives.
//!
//! An interpreter that checks each access to memory (Miri) can run these tests; it cannot load libraries.
#![allow(
    unsafe_code,
    reason = "the tests call functions of the boundary; each use says why it is sound"
)]
#![allow(clippy::unwrap_used)]

use std::ffi::c_void;
use std::ptr;
use std::sync::Arc;

use lacuna::data::{Axis, Layout, Unit};
use lacuna::math::random::Stream;
use lacuna::matrix::Matrix;
use lacuna::plugin::model::{Call, EvalError, Input, Response, Signature};
use lacuna::plugin::{Component, Context, Design, Model};
use lacuna::run::Stop;
use lacuna::run::fault::Fault;
use lacuna_abi::table::{
    Calls, ComponentFunctions, DesignFunctions, Entry, ModelFunctions, Numbers, Text, copied,
};
use lacuna_abi::wire::CallsAbout;
use lacuna_abi::{Object, Refusal, Reply, status};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::declaration;

/// A line through the points of its one axis; it refuses a negative slope and panics at a slope of 13.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Line {
    /// Value at zero.
    offset: f64,
}

impl Component for Line {}

fn layout() -> Layout {
    let unit = Unit::parse("m").unwrap();
    Layout {
        name: "height".into(),
        unit: unit.clone(),
        axes: vec![Axis::grid("x", vec![0.0, 1.0, 2.5], unit)],
    }
}

impl Model for Line {
    fn signature(&self, _: &Context<'_>) -> Signature {
        let input = Input {
            name: "slope".into(),
            unit: Unit::parse("1").unwrap(),
            default: None,
            range: (f64::NEG_INFINITY, f64::INFINITY),
            description: "slope of the line".into(),
        };
        Signature { inputs: vec![input], layout: layout(), resamples: true }
    }

    fn predict(&self, call: &Call<'_>) -> Result<Response, EvalError> {
        let slope = call.inputs[0];
        assert!(slope != 13.0, "an unlucky slope");
        if slope < 0.0 {
            return Err(EvalError::Rejected(format!("the slope {slope} is negative")));
        }
        let values = [0.0, 1.0, 2.5].map(|x| self.offset + slope * x).to_vec();
        Ok(Response { values, valid: slope < 5.0, facts: Vec::new() })
    }
}

/// Points on the diagonal of the cube.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
struct Diagonal {}

impl Component for Diagonal {}

impl Design for Diagonal {
    fn points(&self, count: usize, dimension: usize, _: &Stream) -> Result<Matrix, Stop> {
        if count > 100 {
            return Err(Stop::new("the diagonal has room for 100 points"));
        }
        Ok(Matrix::from_fn(count, dimension, |i, _| (i as f64 + 0.5) / count as f64))
    }
}

/// A plugin that the functions of its entry made from options; `functions` are those of its kind.
fn made<F>(entry: &Entry, functions: F, options: &str) -> Result<Object<F>, Refusal> {
    // SAFETY: the table is that of the entry, which lives as long as the program.
    let component = unsafe { copied(entry.component) }?;
    let ComponentFunctions { create, destroy, .. } = component;
    let mut this: *mut c_void = ptr::null_mut();
    Reply::of("create", |answer| {
        // SAFETY: the text and the place for the pointer are there until the call returns.
        unsafe { create.unwrap()(Text::of(options), &raw mut this, answer) }
    })?;
    Ok(Object::new(this, functions, destroy, Arc::new(Fault::new("the plugin"))))
}

fn line(options: &str) -> Result<Object<ModelFunctions>, Refusal> {
    let entry = declaration::entry::<dyn Model, Line, 3>("model", "line");
    // SAFETY: the table is that of the entry, which is one of a model.
    let functions = unsafe { copied(entry.functions.cast::<ModelFunctions>()) }?;
    made(&entry, functions, options)
}

/// Responses, statuses and marks of validity that `predict` writes for some slopes, and the reply.
fn predicted(slopes: &[f64]) -> (Matrix, Vec<i32>, Vec<u8>, Result<Reply, Refusal>) {
    let line = line(r#"{"offset": 2.0}"#).unwrap();
    let inputs = Matrix::from_vec(slopes.len(), 1, slopes.to_vec());
    let about = CallsAbout {
        names: vec!["slope".into()],
        units: vec![Unit::parse("1").unwrap()],
        layout: layout(),
        scenario: lacuna::data::Scenario::default(),
        study: "lines".into(),
    };
    let about = serde_json::to_string(&about).unwrap();
    let calls = Calls {
        size: size_of::<Calls>(),
        inputs: Numbers::of(&inputs),
        about: Text::of(&about),
        folders: Text::of(""),
    };
    let mut responses = Matrix::zeros(slopes.len(), 3);
    let (mut statuses, mut valid) = (vec![-1; slopes.len()], vec![9; slopes.len()]);
    let (to, codes) = (responses.as_mut_slice().as_mut_ptr(), statuses.as_mut_ptr());
    // SAFETY: the buffers have a place for each call, and the calls are there until the function returns.
    let asked = unsafe { line.predict(&raw const calls, to, codes, valid.as_mut_ptr()) };
    let reply = asked.demand();
    (responses, statuses, valid, reply)
}

#[test]
fn a_model_answers_each_call_of_a_batch() {
    let (responses, statuses, valid, reply) = predicted(&[1.0, -1.0, 6.0]);
    reply.unwrap();
    assert_eq!(responses.row(0), [2.0, 3.0, 4.5]);
    assert_eq!(responses.row(2), [2.0, 8.0, 17.0]);
    assert_eq!(statuses, [status::OK, status::REJECTED, status::OK]);
    assert_eq!((valid[0], valid[2]), (1, 0));
}

#[test]
fn a_panic_does_not_cross_the_boundary() {
    let (.., reply) = predicted(&[1.0, 13.0]);
    let refusal = reply.unwrap_err();
    assert_eq!(refusal.status, status::PANIC);
    assert!(refusal.message.contains("an unlucky slope"), "{}", refusal.message);
}

#[test]
fn wrong_options_are_complaints() {
    for options in [r#"{"offset": "high"}"#, r#"{"ofset": 1.0}"#, "no JSON"] {
        assert!(line(options).is_err(), "{options}");
    }
}

#[test]
fn a_design_fills_the_buffer_or_says_why_not() {
    let entry = declaration::entry::<dyn Design, Diagonal, 1>("design", "diagonal");
    // SAFETY: the table is that of the entry, which is one of a design.
    let functions = unsafe { copied(entry.functions.cast::<DesignFunctions>()) }.unwrap();
    let design = made(&entry, functions, "{}").unwrap();
    let ask = |count: usize, points: &mut [f64]| {
        // SAFETY: the buffer has a place for each coordinate.
        unsafe { design.points(count, 2_usize, &Stream::root(1), points.as_mut_ptr()) }.demand()
    };
    let mut points = vec![0.0; 8];
    ask(4, &mut points).unwrap();
    assert_eq!(points, [0.125, 0.125, 0.375, 0.375, 0.625, 0.625, 0.875, 0.875]);
    let refusal = ask(101, &mut vec![0.0; 202]).unwrap_err();
    assert!(refusal.message.contains("room for 100 points"), "{}", refusal.message);
}
