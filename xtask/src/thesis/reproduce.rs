//! Everything the reproduction makes, and where it goes.

use std::fmt::Write as _;
use std::path::Path;

use rayon::prelude::*;

use super::published::Published;
use super::results::Results;
use super::{audit, golden, tables};
use crate::{drawing, figures};

/// One table or figure: its data, and how a reader sees it.
#[derive(Debug, Clone)]
pub struct Artefact {
    /// File stem, such as `table-5.6.4` or `figure-5.2.4`.
    pub name: String,
    /// All digits of its data; `None` for a drawing.
    pub csv: Option<String>,
    /// What a reader looks at.
    pub view: View,
}

/// What a reader looks at.
#[derive(Debug, Clone)]
pub enum View {
    /// A table.
    Markdown(String),
    /// A figure; written as PNG as well.
    Svg(String),
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
}

/// What [`all`] made.
#[derive(Debug, Clone)]
pub struct Reproduction {
    /// Tables, then figures.
    pub artefacts: Vec<Artefact>,
    /// Pages that belong to no single table or figure: file name and Markdown.
    pub pages: Vec<(&'static str, String)>,
}

/// Computes every table and every figure; `tick` is called [`ticks`] times.
///
/// # Errors
/// The words of the computation that fails.
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

/// How many times [`all`] ticks.
///
/// # Errors
/// A sentence naming the published file that cannot be read.
pub fn ticks(root: &Path) -> Result<usize, String> {
    Ok(Results::keys(&Published::read(root)?).len() + figures::numbers().len())
}

/// Whether `only` names the artefact `name` or a part of the dissertation it belongs to: `5.6`
/// means 5.6.1, 5.6.2 and so on, `P1` the first paper, `figure-5.2.4` the figure alone.
fn selects(only: &str, name: &str) -> bool {
    let number = name.split_once('-').map_or(name, |(_, number)| number);
    let begins = |text: &str| {
        text.strip_prefix(only).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '-']))
    };
    begins(number) || begins(name)
}

/// The page that links to everything.
fn index(artefacts: &[Artefact]) -> String {
    let mut text = String::from(
        "# The dissertation, reproduced\n\n\
         Every table and figure of V. Mariano (UFPB, 1998), computed by this workspace.\n\
         Made by `cargo xtask reproduce-thesis`; do not edit.\n\n\
         - **[What the audit found](audit.md)**\n",
    );
    for artefact in artefacts {
        let (kind, number) = artefact.name.split_once('-').unwrap_or(("", &artefact.name));
        let ending = artefact.view.ending();
        let _ = write!(text, "- [{kind} {number}]({}.{ending})", artefact.name);
        if artefact.csv.is_some() {
            let _ = write!(text, " ([data](../../tests/golden/{}.csv))", artefact.name);
        }
        text.push('\n');
    }
    text
}

impl Reproduction {
    /// Only the tables and figures of that number or part.
    ///
    /// # Errors
    /// A sentence with the names there are.
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
    /// A sentence naming the file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<usize, String> {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
        let written: Result<Vec<usize>, String> =
            self.artefacts.par_iter().map(|a| write_artefact(folder, a)).collect();
        for (name, text) in &self.pages {
            write(&folder.join(name), text)?;
        }
        Ok(written?.iter().sum::<usize>() + self.pages.len())
    }

    /// How many artefacts have a golden file.
    pub fn golden_files(&self) -> usize {
        self.artefacts.iter().filter(|a| a.csv.is_some()).count()
    }

    /// Every difference from the golden files, one sentence each.
    pub fn differences(&self, root: &Path) -> Vec<String> {
        self.artefacts.iter().flat_map(|a| golden::differences(root, a)).collect()
    }

    /// Rewrites the golden files.
    ///
    /// # Errors
    /// A sentence naming the file that cannot be written.
    pub fn bless(&self, root: &Path) -> Result<(), String> {
        self.artefacts.iter().try_for_each(|a| golden::bless(root, a))
    }
}

fn write_artefact(folder: &Path, artefact: &Artefact) -> Result<usize, String> {
    let file = |ending: &str| folder.join(format!("{}.{ending}", artefact.name));
    write(&file(artefact.view.ending()), artefact.view.text())?;
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
