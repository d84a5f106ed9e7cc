//! Random fields: the terms of their expansions, and prior and posterior along their coordinates.

use maud::{Markup, html};

use crate::page::chart::{Axis, Band, Curve, Frame, Key, Panel, small_multiples};
use crate::page::number::{count, fixed};
use crate::page::scale::{ShownUnit, extent, padded, printed};
use crate::page::svg::{Area, Path, Svg};
use crate::page::table::Table;
use crate::page::{Caption, Numbers, Section};
use crate::report::findings::{FieldBand, FieldFindings, Findings};

/// The fields; `None` if the study has none.
pub fn section(findings: &Findings, numbers: &mut Numbers) -> Option<Section> {
    let fields = &findings.fields;
    if fields.is_empty() {
        return None;
    }
    let caption = Caption::new(
        "Random fields and their Karhunen-Loève expansions. The coefficients of the terms are among the parameters.",
        "the share of the prior's variance, integrated over the places, that the terms keep.",
        "a neglected share that is not small: what varies over short distances is missing. Keep more terms.",
    );
    let content = html! {
        (numbers.table(&field_table(fields), &caption))
        @for field in fields { (figure(field, numbers)) }
    };
    Some(Section { id: "fields", title: "Random fields", content })
}

/// Table of the fields with their terms.
pub fn field_table(fields: &[FieldFindings]) -> Table {
    let heads = ["places", "terms", "variance kept, %", "neglected, %"];
    let mut table = Table::new(&["field", "unit"], &heads);
    for FieldFindings { field, .. } in fields {
        table.row([
            field.name.clone(),
            printed(&field.unit),
            count(field.at.len()),
            count(field.terms()),
            fixed(100.0 * field.kept, 2),
            fixed(100.0 * (1.0 - field.kept), 2),
        ]);
    }
    table
}

/// A name with letters, digits, `-` and `_` only.
fn file_name(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
    name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect()
}

fn figure(found: &FieldFindings, numbers: &mut Numbers) -> Markup {
    let field = &found.field;
    let at = ShownUnit::for_values(&field.at_unit, field.at.iter().copied());
    let ends = |band: &FieldBand| [&band.q025[..], &band.q975[..]].concat();
    let both = std::iter::once(&found.prior).chain(&found.posterior);
    let all: Vec<f64> = both.flat_map(ends).collect();
    let own = ShownUnit::for_values(&field.unit, all.iter().copied());
    let placed = |values: &[f64]| -> Vec<(f64, f64)> {
        field.at.iter().zip(values).map(|(x, y)| (at.show(*x), own.show(*y))).collect()
    };
    let line = |class, name: &str, values: &[f64]| {
        let (name, points) = (name.to_owned(), placed(values));
        Curve { class, name, points }
    };
    let shown = found.posterior.as_ref().unwrap_or(&found.prior);
    let mut curves = Vec::new();
    if found.posterior.is_some() {
        curves.push(line("s-reference", "2.5 % of the prior", &found.prior.q025));
        curves.push(line("s-reference", "97.5 % of the prior", &found.prior.q975));
    }
    curves.push(line("s-mean", "mean", &shown.mean));
    let (low, high) = (placed(&shown.q025), placed(&shown.q975));
    let edges = low.into_iter().zip(high).map(|((x, low), (_, high))| (x, low, high)).collect();
    let panel = Panel {
        title: field.name.clone(),
        remark: String::new(),
        bands: vec![Band { class: "s-band", edges }],
        curves,
    };
    let range = padded(extent(all.iter().map(|&y| own.show(y))).unwrap_or((0.0, 1.0)), 0.06);
    let domain = (at.show(field.at[0]), at.show(field.at[field.at.len() - 1]));
    let x = Axis::new(at.label(&field.axis), domain).ticks(6);
    let y = Axis::new(own.label(&field.name), range).ticks(4);
    let whose = if found.posterior.is_some() { "posterior" } else { "prior" };
    let mut keys = vec![
        Key::line("s-mean", format!("mean of the {whose}")),
        Key::area("s-band", format!("central 95 % of the {whose}")),
    ];
    if found.posterior.is_some() {
        keys.push(Key::line("s-reference", "central 95 % of the prior"));
    }
    let caption = Caption::new(
        format!("The field `{}` at its places, each by itself.", field.name),
        format!("{whose} of the coefficients; the neglected terms have their prior."),
        "a posterior as wide as the prior: the data say nothing about the field there.",
    );
    let drawings = small_multiples(&[panel], &x, &y, "random field");
    numbers.figure(&format!("field-{}", file_name(&field.name)), &drawings, &keys, &caption)
}

/// A small picture of the posterior of a field along its coordinate, without axes; empty without a posterior.
pub fn sketch(found: &FieldFindings) -> String {
    let Some(band) = &found.posterior else { return String::new() };
    let at = &found.field.at;
    let domain = extent(at.iter().copied()).unwrap_or((0.0, 1.0));
    let range = extent(band.q025.iter().chain(&band.q975).copied()).unwrap_or((0.0, 1.0));
    let area = Area::new(0.0, 2.0, 260.0, 56.0);
    let frame = Frame::new(area, &Axis::new("", domain), &Axis::new("", range));
    let along = |values: &[f64]| -> Vec<(f64, f64)> {
        at.iter().zip(values).map(|(&x, &y)| frame.at((x, y))).collect()
    };
    let mut svg = Svg::new(260.0, 60.0);
    svg.path("s-band", &Path::band(&along(&band.q975), &along(&band.q025)), "");
    svg.path("line s-mean", &Path::through(along(&band.mean)), "");
    svg.finish(&format!("posterior mean and 95 % band of the field {}", found.field.name))
}
