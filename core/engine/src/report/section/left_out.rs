//! Figures of the leave-one-out predictions: the shapes k-hat, and how the data lie in their predictions.

use maud::{Markup, html};

use crate::page::chart::{Axis, Band, Curve, Key, Panel, dot_chart, small_multiples};
use crate::page::number::{count, fixed, percent, significant};
use crate::page::scale::{extent, padded};
use crate::page::{Caption, Numbers};
use crate::report::findings::LeftOutFindings;

/// The figures of the predictions.
pub fn figures(left: &LeftOutFindings, numbers: &mut Numbers) -> Markup {
    html! { (probabilities(left, numbers)) (shapes(left, numbers)) }
}

/// Factor of `1 / sqrt(n)` of the largest difference between the distribution function of `n` independent uniform numbers
/// and the uniform one that is exceeded with a probability of 5 % (Kolmogorov's limiting law; Massart, Annals of Probability
/// 18 (1990) 1269, for any `n`).
const DISTANCE: f64 = 1.3581;

/// Number of places at which the difference is drawn.
const PLACES: usize = 200;

/// Distribution function of the probabilities of values below the measured ones, less the uniform one.
fn probabilities(left: &LeftOutFindings, numbers: &mut Numbers) -> Markup {
    let mut below: Vec<f64> = left.below.iter().copied().filter(|p| p.is_finite()).collect();
    if below.len() < 5 {
        return html! {};
    }
    below.sort_by(f64::total_cmp);
    let n = below.len() as f64;
    let difference = |x: f64| below.partition_point(|p| *p <= x) as f64 / n - x;
    let points: Vec<(f64, f64)> =
        (0..=PLACES).map(|k| k as f64 / PLACES as f64).map(|x| (x, difference(x))).collect();
    let limit = DISTANCE / n.sqrt();
    let largest = points.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
    let panel = Panel {
        title: String::new(),
        remark: format!("largest {}, band {}", significant(largest, 2), significant(limit, 2)),
        bands: vec![Band {
            class: "s-band",
            edges: vec![(0.0, -limit, limit), (1.0, -limit, limit)],
        }],
        curves: vec![
            Curve { class: "s-equal", name: String::new(), points: vec![(0.0, 0.0), (1.0, 0.0)] },
            Curve { class: "s-mean", name: "difference".to_owned(), points },
        ],
    };
    let range = 1.1 * largest.max(limit).max(0.05);
    let x = Axis::new("probability of a value below the datum", (0.0, 1.0)).ticks(5);
    let y = Axis::new("data less uniform [share]", (-range, range)).ticks(5);
    let keys = [
        Key::line("s-mean", "distribution function less the uniform one"),
        Key::area("s-band", "95 % of independent data of the model"),
    ];
    let tails = below.iter().filter(|p| **p < 0.025 || **p > 0.975).count();
    let caption = Caption::new(
        format!(
            "LOO-PIT: the probability of a value below each datum under its prediction from all others, as a distribution \
             function less that of uniform numbers. {} of {} data ({}) are outside of the central 95 % of their predictions.",
            count(tails),
            count(below.len()),
            percent(tails as f64 / n),
        ),
        "leave-one-out posterior predictive of single data. Each is predicted without regard to its neighbours' deviations: the \
         curve of dependent data wanders more than the band says.",
        "below zero on the left and above on the right: the predictions are too wide; the reverse: too narrow. A curve on one \
         side: the model is biased.",
    );
    let drawings = small_multiples(&[panel], &x, &y, "data in their leave-one-out predictions");
    numbers.figure("loo-pit", &drawings, &keys, &caption)
}

/// Largest number of dots of the figure of k-hat.
const MOST_DOTS: usize = 1500;

/// The shape k-hat of each datum, with the limit.
fn shapes(left: &LeftOutFindings, numbers: &mut Numbers) -> Markup {
    let all = left.k_hat.iter().enumerate().map(|(i, &k)| (i as f64 + 1.0, k));
    let known: Vec<(f64, f64)> = all.filter(|(_, k)| k.is_finite()).collect();
    let Some((low, high)) = extent(known.iter().map(|p| p.1)) else { return html! {} };
    let stride = known.len().div_ceil(MOST_DOTS).max(1);
    let is_shown = |(i, p): &(usize, &(f64, f64))| i % stride == 0 || p.1 > left.limit;
    let dots: Vec<(f64, f64)> =
        known.iter().enumerate().filter(is_shown).map(|(_, p)| *p).take(2 * MOST_DOTS).collect();
    let last = left.k_hat.len() as f64 + 0.5;
    let range = padded((low.min(0.0), high.max(left.limit)), 0.06);
    let x = Axis::new("datum [number in the order of the likelihood]", (0.5, last)).ticks(5);
    let y = Axis::new("k-hat", range).ticks(5);
    let limit = Curve {
        class: "s-equal",
        name: "limit".into(),
        points: vec![(0.5, left.limit), (last, left.limit)],
    };
    let description = format!(
        "k-hat of {} data from {} to {}, {} above the limit of {}",
        count(known.len()),
        fixed(low, 2),
        fixed(high, 2),
        count(left.unreliable),
        fixed(left.limit, 2)
    );
    let keys = [Key::dot("s-pair", "datum"), Key::line("s-equal", "limit")];
    let thinned = if stride > 1 {
        format!(" Of those below the limit one in {stride} is drawn.")
    } else {
        String::new()
    };
    let caption = Caption::new(
        format!(
            "PSIS: the shape k-hat of the largest importance ratios of each datum when it is left out.{thinned}"
        ),
        "importance ratios over the draws.",
        "dots above the line: the posterior depends so much on that datum that its prediction cannot be trusted.",
    );
    let drawing = dot_chart(&dots, &[limit], (&x, &y), ("k-hat", &description));
    numbers.figure("k-hat", &[drawing], &keys, &caption)
}
