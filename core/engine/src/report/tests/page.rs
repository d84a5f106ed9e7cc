use lacuna::data::{Axis, Layout};
use lacuna::math::distribution::Distribution;
use lacuna_linalg::Matrix;

use super::fixture::{bare, findings, unit};
use super::xml::{self, Element};
use crate::report::findings::{CoordinateFindings, Findings};
use crate::report::{render, summary_text};

/// Parses the page, and checks that every coordinate of a drawing is a number.
fn elements(findings: &Findings) -> Vec<Element> {
    let page = render(findings);
    let elements = xml::read(&page);
    for element in &elements {
        for key in ["x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "r", "width", "height"] {
            if let Some(value) = element.attribute(key) {
                assert!(value.parse::<f64>().is_ok_and(f64::is_finite), "{key}={value}");
            }
        }
        for key in ["d", "data-x", "data-y", "viewBox", "transform"] {
            if let Some(value) = element.attribute(key) {
                assert!(!value.contains("NaN") && !value.contains("inf"), "{key}={value}");
            }
        }
        if element.name == "text" {
            assert!(!element.text.contains("NaN"), "{}", element.text);
        }
    }
    elements
}

fn texts(elements: &[Element]) -> Vec<&str> {
    elements.iter().map(|e| e.text.as_str()).collect()
}

fn has_text(elements: &[Element], text: &str) -> bool {
    elements.iter().any(|e| e.text == text)
}

#[test]
fn the_page_is_well_formed_self_contained_and_small() {
    let findings = findings();
    let page = render(&findings);
    assert!(page.len() < 3_000_000, "{} bytes", page.len());
    assert_eq!(page, render(&findings), "the page is deterministic");
    for address in ["http:", "https:", "url(", "@import", "src=", "<link"] {
        let page = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!page.contains(address), "{address} in the page");
    }
    elements(&findings);
}

#[test]
fn axes_carry_their_units() {
    let elements = elements(&findings());
    for label in [
        "time [ms]",
        "strain [10⁻⁶]",
        "tensile_cutoff [kPa]",
        "density [kg/m³]",
        "sound_speed [m/s]",
        "variance [10⁻⁹]",
        "standard deviation [10⁻⁶]",
        "tensile_cutoff (x1) [MPa]",
        "simulated strain [10⁻⁶]",
        "accepted moves [share]",
    ] {
        assert!(has_text(&elements, label), "no `{label}` in {:?}", texts(&elements));
    }
    assert!(has_text(&elements, "kg/m³") && !texts(&elements).iter().any(|t| t.contains("kg/m3")));
}

#[test]
fn strain_as_a_unit_is_shown_as_microstrain() {
    let mut findings = findings();
    findings.layouts.blocks[0].unit = unit("strain");
    assert!(has_text(&elements(&findings), "strain [microstrain]"));
}

#[test]
fn figures_are_numbered_in_order_and_say_whose_distribution_they_show() {
    let page = render(&findings());
    let figures = page.matches(" id=\"figure-").count();
    assert!(figures >= 12, "{figures} figures");
    for number in 1..=figures {
        assert_eq!(page.matches(&format!("id=\"figure-{number}\"")).count(), 1);
    }
    for whose in ["posterior", "replicates", "prior", "posterior predictive", "sampling error"] {
        assert!(page.contains(whose));
    }
}

#[test]
fn warnings_come_before_results() {
    let page = render(&findings());
    let (warning, result) = (page.find("stranded far below"), page.find("Posterior means with"));
    assert!(warning.unwrap() < result.unwrap());
}

#[test]
fn evidence_and_predictions_are_told_on_the_page_and_in_the_terminal() {
    let (page, text) = (render(&findings()), summary_text(&findings()));
    for told in [
        "Log evidence −1234.50 ± 0.05 (bridge sampling).",
        "summed: −1200 ± 31 (standard error by curve; 20 as if the data were independent), 3.9 effective",
    ] {
        assert!(page.contains(told) && text.contains(told), "{text}");
    }
}

#[test]
fn directions_in_which_the_response_changes_are_listed() {
    let page = render(&findings());
    // Shares of the sum 1.104 of the eigenvalues.
    let told = "3 of 3 directions carry 99 % of the mean square slope; the largest shares along single inputs";
    assert!(!page.contains(told), "two directions carry 99.6 %");
    assert!(page.contains(&told.replace("3 of 3", "2 of 3")));
    for cell in ["0.900", "0.800", "0.8152", "0.9964"] {
        assert!(page.contains(&format!(">{cell}</td>")), "no {cell}");
    }
}

#[test]
fn stages_that_did_not_run_are_left_out() {
    let elements = elements(&bare());
    assert!(!elements.iter().any(|e| e.name == "svg"));
    assert!(has_text(&elements, "This run has no calibration yet."));
    let sections = elements.iter().filter(|e| e.name == "section").count();
    assert_eq!(sections, 1);
}

#[test]
fn names_that_people_wrote_are_escaped() {
    let mut findings = findings();
    findings.title = "a < b & \"c\" <script>alert('x')</script>".into();
    findings.parameters[0].name = "<x> & \"y\"".into();
    findings.calibration.as_mut().unwrap().coordinates[0].name = "<x> & \"y\"".into();
    findings.warnings.push("`<b>` & `\"q\"`".into());
    findings.layouts.blocks[0].name = "s<t>r & \"ain\"".into();
    let page = render(&findings);
    assert_eq!(page.matches("<script>").count(), 1);
    elements(&findings);
}

#[test]
fn a_sensor_without_measurements_says_so() {
    let mut findings = findings();
    for replicate in &mut findings.measured.as_mut().unwrap().used.blocks[0].replicates {
        replicate.values[..100].fill(None);
    }
    let validation = findings.validation.as_mut().unwrap();
    validation.replicates[..100].fill((0, 0.0, 0.0));
    validation.cases[0].accuracy.remove(0);
    assert!(
        elements(&findings)
            .iter()
            .any(|e| e.text == "nothing measured" || e.text == "0 replicates")
    );
}

#[test]
fn draws_that_never_moved_are_drawn() {
    let mut findings = findings();
    let calibration = findings.calibration.as_mut().unwrap();
    let width = calibration.coordinates.len();
    for (i, draw) in calibration.draws.iter_mut().enumerate() {
        *draw = calibration.coordinates[i % width].mean;
    }
    for c in &mut calibration.coordinates {
        (c.sd, c.mcse_mean, c.r_hat, c.ess_bulk) = (0.0, f64::NAN, f64::NAN, f64::NAN);
        (c.q025, c.q975) = (c.mean, c.mean);
    }
    calibration.correlation = Matrix::from_fn(width, width, |_, _| f64::NAN);
    elements(&findings);
    assert!(summary_text(&findings).contains("–"));
}

#[test]
fn one_draw_of_one_chain_is_enough() {
    let mut findings = findings();
    let calibration = findings.calibration.as_mut().unwrap();
    (calibration.chains, calibration.steps, calibration.burn_in) = (1, 1, 0);
    calibration.draws.truncate(4);
    calibration.acceptance = vec![1.0];
    calibration.stranded.clear();
    elements(&findings);
}

#[test]
fn huge_and_small_numbers_stay_inside_their_figures() {
    for factor in [1e-200, 1e-30, 1e30, 1e150] {
        let mut findings = findings();
        let calibration = findings.calibration.as_mut().unwrap();
        for draw in &mut calibration.draws {
            *draw *= factor;
        }
        for c in &mut calibration.coordinates {
            for value in [
                &mut c.mean,
                &mut c.sd,
                &mut c.q025,
                &mut c.median,
                &mut c.q975,
                &mut c.map,
                &mut c.mcse_mean,
            ] {
                *value *= factor;
            }
        }
        for replicate in &mut findings.measured.as_mut().unwrap().used.blocks[0].replicates {
            for value in replicate.values.iter_mut().flatten() {
                *value *= factor;
            }
        }
        elements(&findings);
    }
}

#[test]
fn a_response_without_a_numeric_axis_is_drawn_as_points() {
    let mut findings = findings();
    let axes = vec![Axis::labels("gauge", ["left", "right", "top"])];
    findings.layouts = Layout { axes, ..findings.layouts.blocks.remove(0) }.into();
    let measured = findings.measured.as_mut().unwrap();
    for replicate in &mut measured.used.blocks[0].replicates {
        replicate.values.truncate(3);
    }
    measured.used.blocks[0].layout = findings.layouts.blocks[0].clone();
    findings.validation = None;
    let elements = elements(&findings);
    assert!(elements.iter().filter(|e| e.name == "circle").count() >= 3);
}

#[test]
fn a_design_even_in_the_logarithm_is_drawn_on_logarithmic_axes() {
    let mut findings = findings();
    let parameter = &mut findings.parameters[0];
    parameter.design = Distribution::LogUniform([1e2, 1e7]);
    parameter.prior = Distribution::LogUniform([1e3, 1e6]);
    let points = &mut findings.ensemble.as_mut().unwrap().points;
    for i in 0..points.rows() {
        points[(i, 0)] = 10.0_f64.powf(2.0 + 5.0 * points[(i, 0)] / 1.5e7);
    }
    let elements = elements(&findings);
    // 100 Pa to 10 MPa, shown in MPa.
    for label in ["10⁻⁴", "0.01", "1"] {
        assert!(has_text(&elements, label), "no `{label}`");
    }
}

#[test]
fn a_variance_for_every_sensor_finds_room() {
    let mut findings = findings();
    let calibration = findings.calibration.as_mut().unwrap();
    let variance = calibration.coordinates[3].clone();
    let draws = std::mem::take(&mut calibration.draws);
    calibration.coordinates.extend((1..10).map(|i| {
        let name = format!("variance_{i}");
        CoordinateFindings { name, ..variance.clone() }
    }));
    calibration.draws = draws.chunks(4).flat_map(|d| d.iter().copied().chain([d[3]; 9])).collect();
    calibration.correlation = Matrix::from_fn(13, 13, |i, j| if i == j { 1.0 } else { 0.1 });
    elements(&findings);
    assert!(render(&findings).len() < 3_000_000, "{}", render(&findings).len());
}

#[test]
fn very_many_chains_and_coordinates_keep_the_page_small() {
    let mut findings = findings();
    let calibration = findings.calibration.as_mut().unwrap();
    let (chains, steps, width) = (1000, 30, 40);
    let variance = calibration.coordinates[3].clone();
    calibration.coordinates.extend((4..width).map(|i| {
        let name = format!("variance_{i}");
        CoordinateFindings { name, ..variance.clone() }
    }));
    calibration.draws =
        (0..chains * steps * width).map(|i| ((i * 7919) % 1009) as f64 * 1e-12).collect();
    (calibration.chains, calibration.steps, calibration.burn_in) = (chains, steps, 10);
    calibration.acceptance = vec![0.3; chains];
    calibration.correlation = Matrix::from_fn(width, width, |i, j| f64::from(i == j));
    elements(&findings);
    assert!(render(&findings).len() < 3_000_000, "{}", render(&findings).len());
}
