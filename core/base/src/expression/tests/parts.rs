//! References and inputs of an expression.

use super::*;

fn is_state(name: &str) -> bool {
    ["x", "v"].contains(&name)
}

fn references(text: &str) -> Vec<String> {
    scope(&["x", "v", "t", "a", "b"]).references(text, "x", &is_state).unwrap()
}

fn inputs(text: &str) -> Vec<String> {
    scope(&["x", "v", "t", "a", "b"]).inputs(text, "t", &is_state).unwrap()
}

#[test]
fn references_are_subtracted_either_way() {
    assert_eq!(references("-a * (x - 293 {K})"), ["293 {K}"]);
    assert_eq!(references("a * (b - x) + (x - b)^2"), ["b"]);
    assert_eq!(references("a * (x - (a + 2 * b))"), ["(a + 2 * b)"]);
    // Neither a state, nor a sum, nor the difference to another product is a reference.
    assert!(references("a * (x - v) + x + a - 2 * x").is_empty());
    for text in ["x - (a + b) * (a - b)", "(a + b) * (a - b) - x"] {
        assert_eq!(references(text), ["(a + b) * (a - b)"], "{text}");
    }
}

#[test]
fn inputs_change_with_time_and_no_state() {
    assert_eq!(inputs("a * sin(2 * pi * t) - b * v"), ["sin(2 * pi * t)"]);
    assert_eq!(inputs("a * (1 + 0.5 * sin(b * t)) - sqrt(x)"), ["sin(b * t)"]);
    // Time alone is no input, and what depends on a state is none.
    assert!(inputs("a * t * v + sin(t * x)").is_empty());
}

#[test]
fn a_text_with_a_fault_has_no_parts() {
    assert!(scope(&["x"]).references("x -", "x", &is_state).is_err());
    assert!(scope(&["x"]).inputs("x -", "t", &is_state).is_err());
}
