//! Every public item documents what its reader needs: errors, units, shapes, and the source of a
//! formula. Every comment is a sentence of plain words.
//!
//! The rules read the sources. An item is public if it can be reached from the root of its crate.
//! The documentation that a rule asks for may stand at the item, at the type that it belongs to, or
//! at the head of its file.

mod comments;
mod items;
mod rules;

use std::path::{Path, PathBuf};

use comments::Comment;
use items::{Item, Source};

/// The crates whose public items other programs use.
const LIBRARIES: [&str; 15] = [
    "signal",
    "numerics",
    "model",
    "bearing",
    "integrate",
    "spectra",
    "estimate",
    "checks",
    "force",
    "io",
    "analysis",
    "plot",
    "report",
    "problems",
    "mechid",
];

/// The sources whose private comments follow the rules, too: all crates and `xtask`.
const CLEAN: [&str; 20] = [
    "crates/analysis",
    "crates/bearing",
    "crates/checks",
    "crates/cli",
    "crates/estimate",
    "crates/force",
    "crates/integrate",
    "crates/io",
    "crates/mechid",
    "crates/modal",
    "crates/model",
    "crates/nonlinear",
    "crates/numerics",
    "crates/plot",
    "crates/problems",
    "crates/python",
    "crates/report",
    "crates/signal",
    "crates/spectra",
    "xtask",
];

fn folder(library: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates").join(library).join("src")
}

/// Returns the places of the items of these crates that break a rule.
fn breaches(libraries: &[&str], breaks: impl Fn(&Item) -> bool) -> Vec<String> {
    let mut found = Vec::new();
    for library in libraries {
        let items = Source::of(&folder(library)).items();
        assert!(items.len() > 5, "{library} has {} public items", items.len());
        let wrong = items.iter().filter(|item| breaks(item));
        found.extend(wrong.map(|item| format!("{library}: {}", item.place)));
    }
    found
}

#[track_caller]
fn none(found: &[String], what: &str) {
    assert!(found.is_empty(), "{} {what}:\n{}", found.len(), found.join("\n"));
}

#[test]
fn what_can_fail_says_how() {
    none(&breaches(&LIBRARIES, rules::hides_its_errors), "public functions without `# Errors`");
}

#[test]
fn what_computes_says_after_whom() {
    none(&breaches(&LIBRARIES, rules::hides_its_source), "public functions without `# Source`");
}

#[test]
fn summaries_begin_with_a_verb_or_a_noun() {
    let found = breaches(&LIBRARIES, rules::begins_with_a_fragment);
    none(&found, "public items whose summary begins with a fragment");
}

#[test]
fn numbers_have_units() {
    none(&breaches(&LIBRARIES, rules::hides_its_units), "public items without a unit");
}

#[test]
fn lists_and_matrices_have_shapes() {
    none(&breaches(&LIBRARIES, rules::hides_its_shape), "public items without a shape");
}

/// Returns the places and faults of the comments of the sources in `CLEAN`.
fn faults(fault: impl Fn(&Comment) -> Option<String>) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let of_one = |name: &&str| {
        let comments = comments::below(&root.join(name).join("src"));
        assert!(comments.len() > 5, "{name}: {} comments", comments.len());
        comments
    };
    let comments = CLEAN.iter().flat_map(of_one);
    comments.filter_map(|c| fault(&c).map(|fault| format!("{}: {fault}", c.place))).collect()
}

#[test]
fn comments_are_sentences() {
    let faults = faults(|comment| comment.fragment().map(str::to_owned));
    none(&faults, "comments that begin with a fragment");
}

#[test]
fn comments_are_wrapped() {
    let faults = faults(|comment| comment.is_wide().then(|| format!("{} columns", comment.width)));
    none(&faults, "comments with lines that are too long");
}

#[test]
fn comments_have_plain_words() {
    let phrases = comments::phrases();
    let faults = faults(|comment| comment.phrase(&phrases).map(str::to_owned));
    none(&faults, "comments with a phrase of `phrases.txt`");
}

/// Checks that no message of the log has a value in debug format (`:?`), because the program shows
/// these messages as its progress.
#[test]
fn progress_is_reported_in_words() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found = Vec::new();
    let folders = CLEAN.iter().map(|name| root.join(name).join("src"));
    for file in folders.flat_map(|folder| comments::sources_below(&folder)) {
        let text = std::fs::read_to_string(&file).unwrap();
        for (at, _) in text.match_indices("log::debug!").chain(text.match_indices("log::trace!")) {
            let call = text[at..].split_inclusive(';').next().unwrap_or_default();
            if call.contains(":?}") {
                found.push(format!("{}: {call}", file.display()));
            }
        }
    }
    none(&found, "messages of progress that print values of the program");
}

/// The rules find each fault in comments of each kind, and none in good comments.
#[test]
fn faults_of_comments_are_found() {
    let source = "//! Force that is told.\n\n/// Whether it is so.\nfn f() {\n    // Level of noise.\n    \
                  // The rest of it.\n    let x = 1;\n    /// ```\n    /// let of_which = 1;\n    /// ```\n}\n\
                  \n#[cfg(test)]\nmod tests {\n    // Whose?\n}\n";
    let found = comments::read(source, "f.rs");
    let places: Vec<&str> = found.iter().map(|comment| comment.place.as_str()).collect();
    assert_eq!(places, ["f.rs:1", "f.rs:3", "f.rs:5", "f.rs:8"]);
    let fragments: Vec<_> = found.iter().map(Comment::fragment).collect();
    assert_eq!(fragments, [None, Some("Whether"), None, None]);
    let phrases: Vec<_> = found.iter().map(|c| c.phrase(&["told", "of which"])).collect();
    assert_eq!(phrases, [Some("told"), None, None, None]);
    assert_eq!(found[2].lines, ["Level of noise.", "The rest of it."]);
    let wide = comments::read(&format!("// {}\n", "word ".repeat(20)), "f.rs");
    assert!(wide[0].is_wide() && !found[2].is_wide());
    assert!(comments::phrases().contains(&"up to which"));
}

/// The front page of every library has an example that `cargo test --doc` runs and that checks a
/// result.
#[test]
fn front_pages_have_an_example_that_is_run() {
    for library in LIBRARIES {
        let page = std::fs::read_to_string(folder(library).join("lib.rs")).unwrap();
        let page: Vec<&str> = page.lines().map_while(|line| line.strip_prefix("//!")).collect();
        let mut fences = page.iter().enumerate().filter(|(_, line)| line.trim() == "```");
        let (Some((first, _)), Some((last, _))) = (fences.next(), fences.next()) else {
            panic!("{library} has no example");
        };
        let example = page[first..last].join("\n");
        assert!(example.contains("use mechid") && example.contains("assert"), "{library}");
    }
}

/// The rules find the sentences that documentation lacks, and accept complete documentation.
#[test]
fn the_rules_tell_good_from_bad() {
    let read = |text: &str| Source::of_text(text).items();
    let bad = "
        pub fn weighed(mass: f64, x: &DVector<f64>) -> Result<f64, E> {
            let mut sum = 0.0;
            for k in 0..3 { sum += x[k] * mass; }
            Ok(sum)
        }";
    let item = &read(bad)[0];
    assert!(rules::hides_its_errors(item) && rules::hides_its_source(item));
    assert!(rules::hides_its_units(item) && rules::hides_its_shape(item));
    let good = format!(
        "/// Weighs x (m, one entry per degree of freedom) by a mass (kg).
        ///
        /// # Errors
        /// If not.
        ///
        /// # Source
        /// Hamming (1973), chapter 2.
        {bad}"
    );
    let item = &read(&good)[0];
    assert!(!rules::hides_its_errors(item) && !rules::hides_its_source(item));
    assert!(!rules::hides_its_units(item) && !rules::hides_its_shape(item));
    let hidden = "mod a { pub fn unseen() -> Result<f64, E> { Ok(1.0) } }
        pub(crate) fn inner() -> Result<f64, E> { Ok(1.0) }
        #[cfg(test)] mod tests { pub fn tested() -> Result<f64, E> { Ok(1.0) } }";
    assert_eq!(read(hidden).len(), 0);
    assert_eq!(read(&format!("pub use a::unseen; {hidden}")).len(), 1);
    for (docs, fragment) in [
        ("What the filter leaves.", true),
        ("Whether it is so.", true),
        ("Of each channel the level.", true),
        ("Returns whether it is so.", false),
        ("`If` as a keyword.", false),
        ("Φ, 2n×2n.", false),
        ("Level of each channel.", false),
    ] {
        let items = read(&format!("/// {docs}\npub const LEVEL: f64 = 1.0;"));
        assert_eq!(rules::begins_with_a_fragment(&items[0]), fragment, "{docs}");
    }
    // A function that only returns, converts or compares a value needs no source.
    for plain in ["self.dt", "1.0 / self.dt", "if self.dt > x { x } else { self.dt }"] {
        let text =
            format!("pub struct S; impl S {{ pub fn f(&self, x: f64) -> f64 {{ {plain} }} }}");
        let items = read(&text);
        assert!(!rules::hides_its_source(&items[1]), "{plain}");
    }
}
