//! The book's page of limits lists the constants of every `limits` module as they are in the
//! sources.
//!
//! With the variable `MECHID_BLESS` set, the test writes the page instead of comparing it.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use syn::spanned::Spanned as _;
use syn::{Attribute, Expr, Item, Lit, Meta};

const HEAD: &str = "# Limits\n\n\
    The numbers that decide something: each is a constant in the module `limits` of its crate, and\n\
    this page is made from those modules. Where a likelihood, an information criterion or a p-value\n\
    can decide, there is no limit.\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A constant: its value as the source writes it, and its comment in one line.
struct Limit {
    name: String,
    value: String,
    comment: String,
}

/// Returns the comment of an item, its paragraphs joined to one line.
fn comment(attributes: &[Attribute]) -> String {
    let mut lines = Vec::new();
    for attribute in attributes {
        if let Meta::NameValue(meta) = &attribute.meta
            && meta.path.is_ident("doc")
            && let Expr::Lit(literal) = &meta.value
            && let Lit::Str(text) = &literal.lit
        {
            lines.push(text.value().trim().to_owned());
        }
    }
    lines.retain(|line| !line.is_empty());
    lines.join(" ")
}

/// Replaces the links of a comment by their text, because their targets are paths in the source.
fn without_links(comment: &str) -> String {
    let mut text = String::new();
    let mut rest = comment;
    while let Some(start) = rest.find('[') {
        let (before, from) = rest.split_at(start);
        text.push_str(before);
        let Some(end) = from.find(']') else {
            rest = from;
            break;
        };
        text.push_str(&from[1..end]);
        rest = &from[end + 1..];
        if rest.starts_with('(')
            && let Some(close) = rest
                .find("()")
                .map(|at| at + 2)
                .filter(|at| rest[*at..].starts_with(')'))
                .or_else(|| rest.find(')'))
        {
            rest = &rest[close + 1..];
        }
    }
    text + rest
}

/// Returns the numbers of the module `limits` of a crate, in the order of the source.
fn limits(file: &Path) -> Vec<Limit> {
    let source = fs::read_to_string(file).unwrap();
    let lines: Vec<&str> = source.lines().collect();
    let mut limits = Vec::new();
    for item in syn::parse_file(&source).unwrap().items {
        let Item::Const(constant) = item else { continue };
        let span = constant.expr.span();
        let (start, end) = (span.start(), span.end());
        let part = |number: usize| {
            let line: Vec<char> = lines[number - 1].chars().collect();
            let from = if number == start.line { start.column } else { 0 };
            let to = if number == end.line { end.column } else { line.len() };
            line[from..to].iter().collect::<String>().trim().to_owned()
        };
        let value = (start.line..=end.line).map(part).collect::<Vec<_>>().join(" ");
        let comment = without_links(&comment(&constant.attrs));
        limits.push(Limit { name: constant.ident.to_string(), value, comment });
    }
    limits
}

/// Returns the files `limits.rs` below a folder, in the order of their paths.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort_by_key(|path| (path.is_dir(), path.clone()));
    let below = |path: PathBuf| {
        if path.is_dir() {
            files(&path)
        } else {
            Some(path).filter(|path| path.ends_with("limits.rs")).into_iter().collect()
        }
    };
    entries.into_iter().flat_map(below).collect()
}

/// Returns the modules `limits` of all crates with their names, such as `mechid_modal::ambient`.
fn modules() -> Vec<(String, PathBuf)> {
    let crates = root().join("crates");
    let mut folders: Vec<PathBuf> =
        fs::read_dir(&crates).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.retain(|folder| folder.join("src").is_dir());
    folders.sort();
    let mut modules = Vec::new();
    for folder in folders {
        let source = folder.join("src");
        let name = folder.file_name().unwrap().to_string_lossy();
        for file in files(&source) {
            let module = file.parent().unwrap().strip_prefix(&source).unwrap();
            let path = module.iter().map(|part| format!("::{}", part.to_string_lossy()));
            modules.push((format!("mechid_{name}{}", path.collect::<String>()), file));
        }
    }
    modules
}

fn page() -> String {
    let mut page = HEAD.to_owned();
    for (module, file) in modules() {
        write!(page, "\n## `{module}`\n\n").unwrap();
        for Limit { name, value, comment } in limits(&file) {
            writeln!(page, "- `{name}` = `{value}`: {comment}").unwrap();
        }
    }
    page
}

#[test]
fn the_page_of_limits_is_that_of_the_sources() {
    let file = root().join("docs/book/src/reference/limits.md");
    let page = page();
    if std::env::var_os("MECHID_BLESS").is_some() {
        fs::write(&file, &page).unwrap();
    }
    let written = fs::read_to_string(&file).unwrap_or_default();
    let differs =
        page.lines().zip(written.lines().chain(std::iter::repeat(""))).find(|(a, b)| a != b);
    assert!(
        differs.is_none() && page.len() == written.len(),
        "MECHID_BLESS=1 writes the page anew; the first line that differs: {differs:?}"
    );
}

#[test]
fn every_limit_says_what_it_limits() {
    let all = modules().into_iter().flat_map(|(module, file)| {
        limits(&file).into_iter().map(move |limit| (module.clone(), limit))
    });
    let silent = all.filter(|(_, limit)| limit.comment.len() < 10);
    let silent: Vec<String> =
        silent.map(|(module, one)| format!("{module}: {}", one.name)).collect();
    assert!(silent.is_empty(), "limits without a comment: {silent:?}");
}

#[test]
fn links_are_left_out_of_comments() {
    let text = "At most [`MANY`], see [`adjust`](super::adjust()) and [x](y) [open";
    assert_eq!(without_links(text), "At most `MANY`, see `adjust` and x [open");
}
