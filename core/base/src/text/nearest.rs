//! Suggestions ("did you mean"): the known word closest to an unknown one.

/// Longest word that is compared, in bytes: the time grows with its length, and nothing that is known is nearly as long.
const LONGEST: usize = 200;

/// The candidate that `word` was most likely meant to be; `None` if none is close enough to suggest.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > LONGEST {
        return None;
    }
    let lower = word.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| (strsim::jaro_winkler(&lower, &candidate.to_lowercase()), candidate))
        .filter(|(score, candidate)| *score > 0.85 || few_edits(&lower, candidate))
        // The first of equal candidates is taken, so that the answer follows the order of the list.
        .reduce(|best, next| if next.0 > best.0 { next } else { best })
        .map(|(_, candidate)| candidate)
}

fn few_edits(word: &str, candidate: &str) -> bool {
    let length = word.chars().count();
    let allowed = (length / 3).min(2);
    // The distance is never below the difference of the lengths, which is known sooner.
    candidate.chars().count().abs_diff(length) <= allowed
        && strsim::damerau_levenshtein(word, &candidate.to_lowercase()) <= allowed
}

/// A list of names for a sentence: "`a`, `b` or `c`".
pub fn one_of<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names: Vec<String> = names.into_iter().map(|name| format!("`{name}`")).collect();
    let Some(last) = names.pop() else { return "nothing".into() };
    if names.is_empty() { last } else { format!("{} or {last}", names.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggests_what_was_meant_and_nothing_else() {
        let keys = ["walkers", "steps", "burn_in"];
        assert_eq!(nearest("walkrs", keys), Some("walkers"));
        assert_eq!(nearest("Burn_In", keys), Some("burn_in"));
        assert_eq!(nearest("setps", keys), Some("steps"));
        assert_eq!(nearest("temperature", keys), None);
        assert_eq!(nearest("x", keys), None);
    }

    #[test]
    fn lists_read_as_sentences() {
        assert_eq!(one_of(["a"]), "`a`");
        assert_eq!(one_of(["a", "b", "c"]), "`a`, `b` or `c`");
        assert_eq!(one_of([]), "nothing");
    }
}
