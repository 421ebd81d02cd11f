//! Artefacts of the reproduction, and their files.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use super::published::Published;
use super::results::Results;
use super::{audit, committed, golden, tables};
use crate::{drawing, figures};

/// One table or figure: its data and its form for a reader.
#[derive(Debug, Clone)]
pub struct Artefact {
    /// File stem, such as `table-5.6.4` or `figure-5.2.4`.
    pub name: String,
    /// Data as CSV with all digits; `None` for a drawing.
    pub csv: Option<String>,
    /// Form for readers: Markdown or SVG.
    pub view: View,
}

/// Form of an artefact for readers.
#[derive(Debug, Clone)]
pub enum View {
    /// A table.
    Markdown(String),
    /// A figure; written as PNG as well.
    Svg(String),
}

impl Artefact {
    /// Returns the name of the file that a reader opens (Markdown or SVG).
    fn file(&self) -> String {
        format!("{}.{}", self.name, self.view.ending())
    }
}

impl View {
    fn ending(&self) -> &'static str {
        match self {
            View::Markdown(_) => "md",
            View::Svg(_) => "svg",
        }
    }

    fn text(&self) -> &str {
        match self {
            View::Markdown(text) | View::Svg(text) => text,
        }
    }

    /// Returns the caption: of a table, the first sentence below its heading; of a figure, its
    /// title without `number`.
    fn caption(&self, number: &str) -> &str {
        match self {
            View::Markdown(text) => {
                let paragraph = text.lines().skip(1).find(|line| !line.is_empty());
                let sentence = paragraph.unwrap_or_default().split(". ").next().unwrap_or_default();
                sentence.trim_end_matches('.')
            }
            View::Svg(text) => {
                let title = text.split("<title>").nth(1).unwrap_or_default();
                let title = title.split("</title>").next().unwrap_or_default();
                title.strip_prefix(number).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(title)
            }
        }
    }
}

/// Artefacts made by [`all`].
#[derive(Debug, Clone)]
pub struct Reproduction {
    /// Tables, then figures.
    pub artefacts: Vec<Artefact>,
    /// Pages without a table or figure of their own: file name and Markdown.
    pub pages: Vec<(&'static str, String)>,
}

/// Computes every table and every figure; `tick` is called [`ticks`] times.
///
/// # Errors
/// The message of the computation that fails.
pub fn all(root: &Path, tick: impl Fn() + Sync) -> Result<Reproduction, String> {
    let published = Published::read(root)?;
    let results = Results::compute(&published, &tick)?;
    let mut artefacts: Vec<Artefact> = tables::all(&published, &results)?
        .into_iter()
        .map(|t| Artefact {
            name: format!("table-{}", t.number),
            csv: Some(t.csv),
            view: View::Markdown(t.markdown),
        })
        .collect();
    artefacts.extend(drawing::all().into_iter().map(|d| Artefact {
        name: format!("figure-{}", d.number),
        csv: None,
        view: View::Svg(d.svg),
    }));
    for made in figures::compute(|_| true, tick)? {
        let name = format!("figure-{}", made.number);
        let svg = made.figure.to_svg().map_err(|e| format!("{name}: {e}"))?;
        let csv = Some(figures::table(&made.figure)?);
        artefacts.push(Artefact { name, csv, view: View::Svg(svg) });
    }
    let audit = audit::page(&published, &results)?;
    let pages = vec![("README.md", index(&artefacts)), ("audit.md", audit)];
    Ok(Reproduction { artefacts, pages })
}

/// Returns the number of times that [`all`] ticks.
///
/// # Errors
/// A message with the published file that cannot be read.
pub fn ticks(root: &Path) -> Result<usize, String> {
    Ok(Results::keys(&Published::read(root)?).len() + figures::numbers().len())
}

/// Returns whether `only` names the artefact `name` or a part of the dissertation that contains it:
/// `5.6` means 5.6.1, 5.6.2 and so on, `P1` the first paper, `figure-5.2.4` only the figure.
fn selects(only: &str, name: &str) -> bool {
    let number = name.split_once('-').map_or(name, |(_, number)| number);
    let begins = |text: &str| {
        text.strip_prefix(only).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '-']))
    };
    begins(number) || begins(name)
}

/// Returns the index page, which has links to all tables and figures.
fn index(artefacts: &[Artefact]) -> String {
    let mut text = String::from(
        "# The dissertation, reproduced\n\n\
         Every table and figure of V. Mariano (UFPB, 1998), computed by this workspace.\n\
         Made by `cargo xtask reproduce-thesis`; do not edit.\n\n\
         - **[What the audit found](audit.md)**\n",
    );
    let mut sorted: Vec<&Artefact> = artefacts.iter().collect();
    sorted.sort_by_key(|artefact| natural(&artefact.name));
    for artefact in sorted {
        let (kind, number) = artefact.name.split_once('-').unwrap_or(("", &artefact.name));
        let _ = write!(text, "- [{kind} {number}]({})", artefact.file());
        if artefact.csv.is_some() {
            let _ = write!(text, " ([data](../../tests/golden/{}.csv))", artefact.name);
        }
        let _ = writeln!(text, ": {}", artefact.view.caption(number));
    }
    text
}

/// Sort key: table 5.6.2 before table 5.6.10, and tables before figures.
fn natural(name: &str) -> (bool, Vec<(usize, String)>) {
    let pieces = name.split(['-', '.']).map(|piece| match piece.parse() {
        Ok(number) => (number, String::new()),
        Err(_) => (usize::MAX, piece.to_owned()),
    });
    (name.starts_with("figure"), pieces.collect())
}

impl Reproduction {
    /// Keeps only the tables and figures that `number` selects: one number, or a part of the
    /// dissertation such as `5.6`.
    ///
    /// # Errors
    /// A message with the names that exist.
    pub fn only(self, number: &str) -> Result<Self, String> {
        let (artefacts, others): (Vec<_>, Vec<_>) =
            self.artefacts.into_iter().partition(|a| selects(number, &a.name));
        if artefacts.is_empty() {
            let names: Vec<&str> = others.iter().map(|a| a.name.as_str()).collect();
            return Err(format!(
                "there is no table or figure {number}; there are {}",
                names.join(", ")
            ));
        }
        Ok(Self { artefacts, pages: Vec::new() })
    }

    /// Writes all files below `folder`, figures as SVG and PNG; returns how many.
    ///
    /// # Errors
    /// A message with the file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<usize, String> {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let written: Result<Vec<usize>, String> =
            self.artefacts.par_iter().map(|a| write_artefact(folder, a)).collect();
        for (name, text) in &self.pages {
            write(&folder.join(name), text)?;
        }
        Ok(written?.iter().sum::<usize>() + self.pages.len())
    }

    /// Returns the number of artefacts with a golden file.
    pub fn golden_files(&self) -> usize {
        self.golden().count()
    }

    /// Names and data of the artefacts with a golden file; a drawing has none.
    fn golden(&self) -> impl Iterator<Item = (&str, &str)> {
        self.artefacts.iter().filter_map(|a| Some((a.name.as_str(), a.csv.as_deref()?)))
    }

    /// Every difference from the golden files and from the tables, figures and pages in the
    /// repository, one sentence each; for a complete reproduction (`whole`) also superfluous files.
    ///
    /// # Errors
    /// A message with the folder that cannot be read.
    pub fn differences(&self, root: &Path, whole: bool) -> Result<Vec<String>, String> {
        let of_golden = |(name, csv)| golden::differences(root, name, csv);
        let mut differences: Vec<String> = self.golden().flat_map(of_golden).collect();
        let views = self.artefacts.iter().map(|a| (a.file(), a.view.text()));
        let pages = self.pages.iter().map(|(name, text)| ((*name).to_owned(), text.as_str()));
        let mut made = BTreeSet::new();
        for (file, text) in views.chain(pages) {
            let path = root.join("docs/thesis").join(&file);
            match std::fs::read_to_string(&path) {
                Ok(committed) if committed::agree(text, &committed) => {}
                Ok(_) => differences.push(format!("docs/thesis/{file} is not what is computed")),
                Err(e) => differences.push(format!("docs/thesis/{file}: {e}")),
            }
            made.insert(file);
        }
        if whole {
            let golden = self.golden().map(|(name, _)| format!("{name}.csv")).collect();
            differences.extend(committed::strays(root, "tests/golden", &["csv"], &golden)?);
            differences.extend(committed::strays(root, "docs/thesis", &["md", "svg"], &made)?);
        }
        Ok(differences)
    }

    /// Rewrites the golden files.
    ///
    /// # Errors
    /// A message with the file that cannot be written.
    pub fn bless(&self, root: &Path) -> Result<(), String> {
        self.golden().try_for_each(|(name, csv)| golden::bless(root, name, csv))
    }
}

fn write_artefact(folder: &Path, artefact: &Artefact) -> Result<usize, String> {
    let file = |ending: &str| folder.join(format!("{}.{ending}", artefact.name));
    write(&folder.join(artefact.file()), artefact.view.text())?;
    let mut files = 1;
    if let Some(csv) = &artefact.csv {
        write(&file("csv"), csv)?;
        files += 1;
    }
    if let View::Svg(svg) = &artefact.view {
        mechid::plot::save_svg(file("png"), svg).map_err(|e| e.to_string())?;
        files += 1;
    }
    Ok(files)
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_sorted_as_they_are_read() {
        let mut names =
            ["figure-P1-4", "table-5.6.10", "figure-5.2.1", "table-5.6.2", "figure-A-damping"];
        names.sort_by_key(|name| natural(name));
        let sorted =
            ["table-5.6.2", "table-5.6.10", "figure-5.2.1", "figure-A-damping", "figure-P1-4"];
        assert_eq!(names, sorted);
    }

    #[test]
    fn captions_are_first_sentences_and_titles() {
        let table = View::Markdown("# Table 1\n\nKxx of it, Nt = 2. In N/m.\n\nMore.\n".into());
        assert_eq!(table.caption("1"), "Kxx of it, Nt = 2");
        let figure =
            View::Svg("<svg><title>5.2.4: K over NPI</title><title>b</title></svg>".into());
        assert_eq!(figure.caption("5.2.4"), "K over NPI");
        let drawing = View::Svg("<svg><title>A force: found</title></svg>".into());
        assert_eq!(drawing.caption("5.4.1"), "A force: found");
    }

    #[test]
    fn a_number_or_a_part_selects() {
        for (only, name, chosen) in [
            ("5.6.1", "table-5.6.1", true),
            ("5.6.1", "table-5.6.10", false),
            ("5.6", "figure-5.6.10", true),
            ("figure-5.2.4", "table-5.2.4", false),
            ("P1", "figure-P1-4", true),
        ] {
            assert_eq!(selects(only, name), chosen, "{only} {name}");
        }
    }
}
