//! Skeletons of plugins, one per kind: complete plugins whose names are replaced.
//!
//! They are compiled and tested together with the contracts (`tests/contracts/skeletons.rs`).

/// A skeleton.
pub struct Skeleton {
    /// Kind, as a study names it.
    pub kind: &'static str,
    /// Trait of the kind, as `register!` takes it.
    pub kind_trait: &'static str,
    /// Folder in `plugins/`.
    pub folder: &'static str,
    /// True if a library can provide plugins of this kind.
    pub in_libraries: bool,
    text: &'static str,
}

macro_rules! skeletons {
    ($($kind:literal $kind_trait:literal $folder:literal $in_libraries:literal),+ $(,)?) => {
        [$(Skeleton {
            kind: $kind,
            kind_trait: $kind_trait,
            folder: $folder,
            in_libraries: $in_libraries,
            text: include_str!(concat!("plugin/", $kind, ".rs")),
        }),+]
    };
}

/// All skeletons, by kind.
pub const ALL: [Skeleton; 12] = skeletons![
    "design" "Design" "designs" true,
    "discrepancy" "Discrepancy" "discrepancies" true,
    "effect" "Effect" "effects" true,
    "executor" "Executor" "executors" false,
    "model" "Model" "models" true,
    "quantity" "Quantity" "quantities" true,
    "reader" "Reader" "readers" true,
    "reliability" "Reliability" "reliability" false,
    "sampler" "Sampler" "samplers" true,
    "surrogate" "Surrogate" "surrogates" true,
    "target" "Density" "targets" false,
    "term" "Term" "terms" false,
];

/// Kinds for which there are skeletons.
pub fn kinds() -> Vec<&'static str> {
    ALL.iter().map(|skeleton| skeleton.kind).collect()
}

/// Names in the skeletons, as a type and as a plugin.
const NAMES: [&str; 2] = ["Skeleton", "skeleton"];

/// Invalid names of modules: the words that Rust uses or reserves.
const KEYWORDS: &str = include_str!("keywords.txt");

/// Types that the skeletons use from the prelude, without importing them.
const PRELUDE: [&str; 13] = [
    "Box", "Clone", "Debug", "Default", "Err", "Iterator", "None", "Ok", "Option", "Result",
    "Some", "String", "Vec",
];

impl Skeleton {
    /// The skeleton of a kind.
    pub fn of(kind: &str) -> Option<&'static Self> {
        ALL.iter().find(|skeleton| skeleton.kind == kind)
    }

    /// The source of the plugin under another name.
    pub fn named(&self, name: &str) -> String {
        self.text.replace(NAMES[0], &type_name(name)).replace(NAMES[1], name)
    }

    /// The fault of a plugin name for this skeleton, and a description of valid names; `None` if the name is valid.
    pub fn fault(&self, name: &str) -> Option<(String, &'static str)> {
        if let Some(fault) = misnamed(name) {
            return Some(fault);
        }
        if KEYWORDS.split_whitespace().any(|word| word == name) {
            let text = format!("`{name}` is a keyword of Rust and cannot name a module");
            return Some((text, "choose another name"));
        }
        let of_code = type_name(name);
        if self.uses(&of_code) || PRELUDE.contains(&of_code.as_str()) {
            let text = format!(
                "the type of `{name}` would be called `{of_code}`, which the code uses already"
            );
            return Some((text, "choose another name, such as one of two words"));
        }
        None
    }

    /// Returns true if the code, without comments, contains the word.
    fn uses(&self, word: &str) -> bool {
        let code = self.text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        word != NAMES[0]
            && code.flat_map(|line| line.split(|c| !is_word(c))).any(|other| other == word)
    }
}

/// The fault of a name that no plugin has, whatever its language, and a description of valid names.
pub fn misnamed(name: &str) -> Option<(String, &'static str)> {
    let sound = |word: &str| {
        !word.is_empty() && word.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    if name.split('_').all(sound) && !name.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    let help = "names are small letters, digits and single underscores, such as `random_walk`";
    Some((format!("`{name}` is no name of a plugin"), help))
}

/// Name of the options type: `random_walk` gives `RandomWalk`.
pub fn type_name(name: &str) -> String {
    let word = |word: &str| {
        let mut letters = word.chars();
        letters
            .next()
            .map_or(String::new(), |c| c.to_ascii_uppercase().to_string() + letters.as_str())
    };
    name.split('_').map(word).collect()
}
