//! Numbers, templates and answers as texts.

use lacuna::data::{Axis, Layout, Unit};

use super::super::answer::printed;
use super::super::number::{Format, shortest};
use super::super::template::{Filling, Template};

#[test]
fn numbers_are_written_as_c_writes_them() {
    let mut lines = 0;
    for line in include_str!("printf.csv").lines().filter(|line| !line.starts_with('#')) {
        let [format, number, expected] = line.split('|').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let written = Format::parse(format).unwrap().write(number.parse().unwrap());
        assert_eq!(written, expected, "{format} of {number}");
        lines += 1;
    }
    assert_eq!(lines, 210);
    for wrong in ["", "%", "e", "%d", "%.3", "%5.2ff", "%*f", "%1000f", "%.101e", "%s"] {
        assert_eq!(Format::parse(wrong), None, "{wrong}");
    }
}

#[test]
fn a_number_without_a_format_reads_back_the_same() {
    for x in [0.1, 1.0 / 3.0, 1e-300, 6.022_140_76e23, 13_500.0, f64::MIN_POSITIVE, -0.0] {
        let text = shortest(x);
        assert_eq!(text.parse::<f64>().unwrap().to_bits(), x.to_bits(), "{text}");
    }
    assert_eq!([shortest(13_500.0), shortest(1e-7)], ["13500.0", "1e-7"]);
}

fn fill(text: &str) -> Result<String, String> {
    Template::parse(text).unwrap().fill(|name| match name {
        "density" => Some(Filling::Number(13_534.0)),
        "run" => Some(Filling::Text("run007".to_owned())),
        _ => None,
    })
}

#[test]
fn places_are_filled_and_the_rest_stays_as_it_is() {
    let deck = "begin {run} }} {\r\n  density = {{density}} $ {{ density | %.3e }}\n{{ run }}.e\n";
    let filled = "begin {run} }} {\r\n  density = 13534.0 $ 1.353e+04\nrun007.e\n";
    assert_eq!(fill(deck).unwrap(), filled);
    assert_eq!(fill("{{ sound_speed }}"), Err("sound_speed".to_owned()));
    let names: Vec<String> = Template::parse(deck)
        .unwrap()
        .places()
        .map(|place| deck[place.at.clone()].to_owned())
        .collect();
    assert_eq!(names, ["density", "density", "run"]);
}

#[test]
fn a_template_that_is_wrong_says_where() {
    for (text, line, column, message) in [
        ("a\nbé {{ a\n}}", 2, 4, "`{{` without `}}` on its line"),
        ("{{ }}", 1, 1, "expected a name between `{{` and `}}`, found ``"),
        ("x\n\n {{ a + b }}", 3, 2, "expected a name between `{{` and `}}`, found `a + b`"),
        ("{{ a | .3f }}", 1, 1, "expected a format such as `%.6e`, `%12.4f` or `%g`, found `.3f`"),
    ] {
        let error = Template::parse(text).unwrap_err();
        assert_eq!(
            (Template::position(text, error.at), &*error.message),
            ((line, column), message)
        );
    }
}

#[test]
fn an_answer_is_nested_flat_or_by_label() {
    let layout = Layout {
        name: "strain".to_owned(),
        unit: Unit::dimensionless(),
        axes: vec![
            Axis::labels("sensor", ["B", "C"]),
            Axis::grid("time", vec![1.0, 2.0, 3.0], Unit::parse("s").unwrap()),
        ],
    };
    let read = |text: &str| printed(text, &layout);
    let values = Ok(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6e-7]);
    assert_eq!(read("[[1, 2, 3], [4, 5, 6e-7]]"), values);
    assert_eq!(read("step 1\nstep 2\n[1, 2, 3, 4, 5, 6e-7]\n\n"), values);
    assert_eq!(read("{\n\"C\": [4, 5, 6e-7],\n\"B\": [1, 2, 3]\n}\n"), values);
    for (text, message) in [
        ("[1, 2, 3]", "the response has 3 values, expected 6"),
        ("[[1, 2], [3, 4], [5, 6]]", "3 values along `sensor`, expected 2"),
        ("[[1, 2, 3], [4, 5]]", "2 values along `time`, expected 3"),
        ("[[1, 2, 3], [4, 5, null]]", "expected a number, found `null`"),
        ("[[1, 2, 3], [4, [5], 6]]", "expected a number, found `[5]`"),
        ("{\"B\": [1, 2, 3]}", "no values of sensor `C`"),
        ("{\"B\": 1, \"C\": 2}", "expected values along `time`, found `1`"),
        ("{\"A\": [1, 2, 3]}", "the response has no sensor `A`"),
        ("7", "expected values along `sensor`, found `7`"),
        ("", "expected the response as JSON in the last line printed, found nothing"),
        ("[1, NaN]", "expected the response as JSON in the last line printed, found `[1, NaN]`"),
    ] {
        assert_eq!(read(text), Err(message.to_owned()), "{text}");
    }
    assert_eq!(printed("2.5", &Layout::number("y")), Ok(vec![2.5]));
    assert_eq!(printed("[2.5]", &Layout::number("y")), Ok(vec![2.5]));
}
