//! Faults: their byte ranges and messages.

use super::*;
use crate::expression::check;
use crate::math::random::{Stream, below};
use crate::matrix::Matrix;

/// The fault of an expression with the unknowns `sigma`, `x`, `t[1]`, `t[2]` and the data `v` (three numbers),
/// `w` (two), `school` (1, 2, 3) and the matrix `X`.
fn fault(text: &str) -> Fault {
    let mut scope = scope(&["sigma", "x", "t[1]", "t[2]"]);
    scope.data("v", Data::Vector(vec![1.0, 2.0, 3.0])).unwrap();
    scope.data("w", Data::Vector(vec![1.0, 2.0])).unwrap();
    scope.data("school", Data::Vector(vec![1.0, 2.0, 3.0])).unwrap();
    scope.data("X", Data::Matrix(Matrix::zeros(2, 2))).unwrap();
    match scope.define("result", text) {
        Err(fault) => fault,
        Ok(()) => scope.compile(&["result"]).expect_err(text).remove(0),
    }
}

/// Expression, text at the byte range of the fault, and its message.
const FAULTS: [(&str, &str, &str); 56] = [
    ("", "", "the expression is empty"),
    ("x + sigmma", "sigmma", "unknown name `sigmma` (help: did you mean `sigma`?)"),
    (
        "exp(x, 2)",
        "exp(x, 2)",
        "wrong number of arguments for `exp`: expected `exp(x)`, found 2 arguments",
    ),
    (
        "if(x > 1, 2)",
        "if(x > 1, 2)",
        "wrong number of arguments for `if`: expected `if(condition, yes, no)`, found 2 arguments",
    ),
    (
        "min()",
        "min()",
        "wrong number of arguments for `min`: expected `min(x, …)`, found no argument",
    ),
    ("expo(x)", "expo", "unknown function `expo` (help: did you mean `exp`?)"),
    ("ln(x)", "ln", "unknown function `ln` (help: did you mean `log`?)"),
    ("x(2)", "x", "unknown function `x` (help: a product with a parenthesis is written with `*`)"),
    ("exp + 1", "exp", "unknown name `exp` (help: a function is called as `exp(x)`)"),
    ("(x + 1", "(", "this `(` is not closed: expected `)`, found the end"),
    ("exp(x", "(", "this `(` is not closed: expected `)`, found the end"),
    ("v[1", "[", "this `[` is not closed: expected `]`, found the end"),
    ("(x, 1)", ",", "`,` does not belong here: expected `)` or an operator, found `,`"),
    ("x + 1)", ")", "nothing is open before `)`: expected an operator, found `)`"),
    ("x +", "", "a value is missing: expected a number, a name or `(`, found the end"),
    ("x * / 2", "/", "a value is missing: expected a number, a name or `(`, found `/`"),
    ("exp(,)", ",", "a value is missing: expected a number, a name or `(`, found `,`"),
    (
        "2 x",
        "x",
        "`x` does not belong here: expected an operator, found `x` (help: a product is written with `*`)",
    ),
    (
        "x ** 2",
        "**",
        "`**` does not belong here: expected an operator, found `**` (help: a power is written `^`)",
    ),
    (
        "x = 2",
        "=",
        "`=` does not belong here: expected an operator, found `=` (help: equality is written `==`)",
    ),
    ("x && x", "&", "`&` has no meaning here (help: write `and`)"),
    (
        "σ + 1",
        "σ",
        "`σ` has no meaning here (help: names are of the letters a to z, digits and `_`)",
    ),
    ("x − 1", "−", "`−` has no meaning here (help: a minus is written `-`)"),
    ("1 < x < 2", "<", "comparisons cannot be chained (help: write `a < b and b < c`)"),
    ("1e999", "1e999", "the number is too large: expected at most 1.7976931348623157e308"),
    (
        "1 + (x > 1)",
        "(x > 1)",
        "a condition is not a number (help: `if(condition, 1, 0)` makes a number of it)",
    ),
    ("if(x, 1, 2)", "x", "a number is not a condition: expected a comparison such as `x > 0`"),
    ("x > 1 and x", "x", "a number is not a condition: expected a comparison such as `x > 0`"),
    ("not x", "x", "a number is not a condition: expected a comparison such as `x > 0`"),
    (
        "x > 1",
        "x > 1",
        "a condition is not a number (help: `if(condition, 1, 0)` makes a number of it)",
    ),
    (
        "x + (v + w)",
        "(v + w)",
        "vectors of different lengths: expected vectors of one length, found 3 and 2 elements",
    ),
    (
        "max(v, x, w)",
        "max(v, x, w)",
        "vectors of different lengths: expected vectors of one length, found 3 and 2 elements",
    ),
    (
        "if(v > 1, w, 0)",
        "if(v > 1, w, 0)",
        "vectors of different lengths: expected vectors of one length, found 3 and 2 elements",
    ),
    (
        "dot(v, w)",
        "dot(v, w)",
        "vectors of different lengths: expected vectors of one length, found 3 and 2 elements",
    ),
    (
        "normal_log_density(v, w, 1)",
        "normal_log_density(v, w, 1)",
        "vectors of different lengths: expected vectors of one length, found 3 and 2 elements",
    ),
    ("sum(x)", "x", "one number stands where a vector belongs: expected a vector"),
    ("x[1]", "x", "one number stands where a vector belongs: expected a vector"),
    ("v[]", "[]", "the index is missing: expected an index such as `[1]` or `[2:5]`"),
    (
        "v[4]",
        "4",
        "there is no element of this index: expected a whole number from 1 to 3, found 4",
    ),
    (
        "v[0]",
        "0",
        "there is no element of this index: expected a whole number from 1 to 3, found 0",
    ),
    (
        "v[1.5]",
        "1.5",
        "there is no element of this index: expected a whole number from 1 to 3, found 1.5",
    ),
    (
        "t[school]",
        "school",
        "there is no element of this index: expected a whole number from 1 to 2, found 3",
    ),
    ("v[x]", "x", "the index depends on an unknown: expected a number, or a vector of data"),
    (
        "v[w:2]",
        "w",
        "a vector stands where one number belongs: expected one number, found a vector of 2",
    ),
    (
        "v[3:2]",
        "v[3:2]",
        "the slice has no elements: expected a first element that is not behind the last, found `3:2`",
    ),
    ("[]", "[]", "an empty list has no values"),
    (
        "X + 1",
        "X",
        "a matrix is not a number (help: `matrix_product(matrix, vector)` makes a vector of it)",
    ),
    ("matrix_product(v, v)", "v", "this is not a matrix: expected data that are a list of rows"),
    (
        "matrix_product(X, v)",
        "v",
        "the vector does not fit the matrix: expected 2 elements, one for each column, found 3",
    ),
    (
        "interpolate(x, v, w)",
        "w",
        "the table has another length than its nodes: expected 3 values, found 2",
    ),
    (
        "interpolate(x, [1, 1], w)",
        "[1, 1]",
        "the nodes do not ascend: expected each node above the one before, found 1 after 1",
    ),
    (
        "interpolate(x, v, v * x)",
        "v * x",
        "the table depends on an unknown: expected a vector of data",
    ),
    (
        "{m} 2",
        "{m}",
        "there is no number before this unit (help: a number with its unit is written `9.81 {m/s2}`)",
    ),
    (
        "x {m}",
        "{m}",
        "`{m}` does not belong here: expected an operator, found `{m}` (help: only a number has a unit of its own)",
    ),
    ("2 {m", "{", "this `{` is not closed: expected a unit and `}`"),
    ("result + 1", "result", "`result` is defined by itself: found `result` by `result`"),
];

#[test]
fn faults_point_at_their_places() {
    for (text, place, line) in FAULTS {
        let fault = fault(text);
        assert_eq!(&text[fault.span.clone()], place, "{text}: {fault}");
        assert_eq!(fault.to_string(), format!("`result`: {line}"), "{text}");
    }
}

#[test]
fn what_is_missing_is_missing_at_its_place() {
    assert_eq!(check("x +  ").unwrap_err().span, 5..5);
    assert_eq!(check("exp(2 * , 3)").unwrap_err().span, 8..9);
}

#[test]
fn nesting_has_an_end() {
    for text in ["(".repeat(5000), "-".repeat(5000), "2^".repeat(5000), "exp(".repeat(5000)] {
        let fault = check(&text).unwrap_err();
        assert_eq!(fault.message, "more than 200 levels of nesting", "{}", &text[..8]);
    }
}

#[test]
fn any_text_is_read_or_refused() {
    let words = [
        "x", "1", "(", ")", "[", "]", ",", ":", "+", "-", "^", "*", "<", "and", "not", "exp(",
        "min(", " ", "{m}", "e", ".", "µ", "if(",
    ];
    let mut rng = Stream::root(5).generator();
    let mut right = 0;
    for _ in 0..20_000 {
        let length = below(&mut rng, 7);
        let text: String = (0..length).map(|_| words[below(&mut rng, words.len())]).collect();
        let mut scope = scope(&["x"]);
        match scope
            .define("result", &text)
            .map_err(|f| vec![f])
            .and_then(|()| scope.compile(&["result"]))
        {
            Ok(program) => {
                program.gradient(&[0.5]);
                right += 1;
            }
            Err(faults) => {
                for fault in faults {
                    assert!(text.get(fault.span.clone()).is_some(), "{text}: {fault}");
                    assert!(fault.render(&text).contains(&fault.message));
                }
            }
        }
    }
    assert!(right > 300, "{right}");
}

#[test]
fn every_definition_has_its_fault_and_consequences_have_none() {
    let mut scope = scope(&["x"]);
    for (name, text) in [("a", "x + zz"), ("b", "a + 1"), ("c", "sum(x)"), ("d", "x")] {
        scope.define(name, text).unwrap();
    }
    let faults = scope.compile(&["d"]).unwrap_err();
    let names: Vec<&str> = faults.iter().map(|fault| fault.definition.as_str()).collect();
    assert_eq!(names, ["a", "c"]);
}

#[test]
fn circles_are_shown() {
    let mut scope = scope(&["x"]);
    for (name, text) in [("a", "x + b"), ("b", "2 * c"), ("c", "exp(b)"), ("d", "c")] {
        scope.define(name, text).unwrap();
    }
    let faults = scope.compile(&["a"]).unwrap_err();
    assert_eq!(faults.len(), 1);
    let fault = &faults[0];
    assert_eq!(fault.to_string(), "`c`: `c` is defined by itself: found `c` by `b` by `c`");
    assert_eq!(fault.span, 4..5);
}

#[test]
fn names_that_cannot_be_or_are_taken_are_refused() {
    let mut scope = scope(&["x", "t[1]"]);
    for (name, message) in [
        ("two words", "`two words` cannot be a name in an expression"),
        ("2x", "`2x` cannot be a name in an expression"),
        ("not", "`not` cannot be a name in an expression"),
        ("", "`` cannot be a name in an expression"),
        ("x", "there are two of the name `x`"),
        ("x[1]", "there are two of the name `x[1]`"),
        ("t", "there are two of the name `t`"),
        ("t[1]", "there are two of the name `t[1]`"),
    ] {
        assert_eq!(scope.unknown(name).unwrap_err().message, message);
    }
    scope.unknown("t[3]").unwrap();
    let faults = scope.compile(&[]).unwrap_err();
    assert_eq!(faults[0].message, "the vector `t` has no element `t[2]`");
    assert_eq!(
        scope.data("empty", Data::Vector(Vec::new())).unwrap_err().message,
        "the data `empty` are empty"
    );
}
