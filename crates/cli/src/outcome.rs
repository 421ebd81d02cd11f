//! Result of a subcommand, and its output.

use std::ffi::OsString;
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use mechid::io::{
    BegunFile, OutputFile, escaped, is_standard_output, refuse_replaced_inputs, write_all,
};
use mechid::plot::{Figure, svg_to_png};
use mechid::report::{FigureStyle, PageSettings, ToFigure, figure_page};
use serde::Serialize;

use crate::args::{FigureArgs, PlotArgs, ReportArgs};
use crate::error::CliError;
use crate::{options, repeat};

/// Number of pixels of a PNG file per px of the drawing.
const PNG_SCALE: f64 = 2.0;

/// Returns a page with one figure and the command of these arguments.
fn page(figure: Figure, words: &[OsString]) -> Result<String, CliError> {
    let title = Some(figure.name().to_owned());
    let settings = PageSettings { title, ..repeat::settings(words) };
    Ok(figure_page(vec![(String::new(), figure)], None, &settings)?)
}

/// Files that a subcommand reads and writes, as far as its arguments name them.
#[derive(Debug, Default)]
pub struct Files<'a> {
    inputs: Vec<&'a Path>,
    outputs: Vec<&'a Path>,
}

impl<'a> Files<'a> {
    /// Adds files that are read.
    pub fn reads(mut self, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.inputs.extend(inputs.into_iter().map(PathBuf::as_path));
        self
    }

    /// Adds files that are written.
    pub fn writes(mut self, outputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.outputs.extend(outputs.into_iter().map(PathBuf::as_path));
        self
    }

    /// Refuses an output that is an input, through any path or link.
    pub fn check(&self) -> Result<(), CliError> {
        Ok(refuse_replaced_inputs(&self.inputs, &self.outputs)?)
    }
}

/// Result of a subcommand, complete before anything is written or printed.
#[derive(Debug)]
pub struct Outcome {
    /// Text for the user.
    text: String,
    /// `true` if settings in the text are named between backticks.
    names_settings: bool,
    /// Report for programs.
    json: String,
    /// Files to write.
    files: Vec<OutputFile>,
    /// Files too long for the memory, complete except for their final names.
    begun: Vec<BegunFile>,
    /// `true` if a requested result is missing.
    is_incomplete: bool,
}

impl Outcome {
    /// Creates an outcome with `text` for the user and the fields of `report` for programs.
    pub fn new(text: String, report: &impl Serialize) -> Result<Self, CliError> {
        let json = serde_json::to_string_pretty(report)? + "\n";
        Ok(Self {
            text,
            names_settings: true,
            json,
            files: Vec::new(),
            begun: Vec::new(),
            is_incomplete: false,
        })
    }

    /// Creates an outcome that is only a text.
    pub fn from_text(text: String) -> Self {
        Self {
            text,
            names_settings: false,
            json: String::new(),
            files: Vec::new(),
            begun: Vec::new(),
            is_incomplete: false,
        }
    }

    /// Marks the outcome as incomplete: the exit code shows that a requested result is missing.
    pub fn incomplete(self) -> Self {
        Self { is_incomplete: true, ..self }
    }

    /// Returns whether everything requested has a result.
    pub fn is_complete(&self) -> bool {
        !self.is_incomplete
    }

    /// Adds a file to write.
    pub fn with_file(mut self, path: &Path, content: impl Into<Vec<u8>>) -> Self {
        self.files.push(OutputFile { path: path.to_owned(), content: content.into() });
        self
    }

    /// Adds a complete file that only needs its final name.
    pub fn with_begun(mut self, file: BegunFile) -> Self {
        self.begun.push(file);
        self
    }

    /// Adds the figure for `--plot`, drawn only if requested; `words` are the arguments of the
    /// program.
    pub fn with_plot(
        self,
        plot: &PlotArgs,
        words: &[OsString],
        figure: impl FnOnce() -> Result<Figure, CliError>,
    ) -> Result<Self, CliError> {
        let Some(path) = &plot.plot else { return Ok(self) };
        let figure = figure()?;
        self.with_drawing(path, &figure.to_svg()?, || page(figure, words))
    }

    /// Adds a drawing in the format that the ending of the file names: PNG, an HTML page, or
    /// otherwise SVG.
    pub fn with_drawing(
        self,
        path: &Path,
        svg: &str,
        page: impl FnOnce() -> Result<String, CliError>,
    ) -> Result<Self, CliError> {
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        let content = match ending.as_deref().and_then(|ending| ending.to_str()) {
            Some("png") => svg_to_png(svg, PNG_SCALE)?,
            Some("html") => options::spelled(&page()?).into_bytes(),
            _ => svg.as_bytes().to_vec(),
        };
        Ok(self.with_file(path, content))
    }

    /// Adds the figure of a result for `--plot`, or its page with the details of its record.
    pub fn with_result_page(
        self,
        page: &FigureArgs,
        (record, words): (&Path, &[OsString]),
        result: &impl ToFigure,
        style: FigureStyle,
    ) -> Result<Self, CliError> {
        match (&page.plot.plot, page.settings(record, words)?) {
            (Some(path), Some(settings)) => {
                let page = result.page_with(style, &settings)?;
                Ok(self.with_file(path, options::spelled(&page)))
            }
            _ => self.with_plot(&page.plot, words, || Ok(result.styled_figure(style)?)),
        }
    }

    /// Adds the figure or page of a result for `--plot`.
    pub fn with_result_plot(
        self,
        plot: &PlotArgs,
        words: &[OsString],
        result: &impl ToFigure,
        style: FigureStyle,
    ) -> Result<Self, CliError> {
        match &plot.plot {
            Some(path) if plot.is_page() => {
                let page = result.page_with(style, &repeat::settings(words))?;
                Ok(self.with_file(path, options::spelled(&page)))
            }
            _ => self.with_plot(plot, words, || Ok(result.styled_figure(style)?)),
        }
    }

    /// Writes all files or none, and prints the report. If a file goes to standard output, the
    /// report goes to the error stream, so that the reader of standard output receives only the
    /// file.
    ///
    /// `spelled` replaces the names of settings in the report by options.
    pub fn deliver(
        self,
        report: &ReportArgs,
        spelled: impl Fn(&str) -> String,
    ) -> Result<(), CliError> {
        let taken = self.begun.iter().filter(|file| file.is_for_standard_output()).count()
            + self.files.iter().filter(|file| is_standard_output(&file.path)).count();
        if taken + usize::from(report.json) > 1 && taken > 0 {
            return Err(CliError::SharedOutput { files: taken, json: report.json });
        }
        write_all(self.begun, &self.files)?;
        let text = match report {
            ReportArgs { json: true, .. } => shown_json(&self.json),
            ReportArgs { quiet: true, .. } => return Ok(()),
            _ if self.names_settings => shown(&spelled(&self.text)),
            _ => shown(&self.text),
        };
        match taken {
            0 => print(io::stdout().lock(), &text)?,
            _ => print(io::stderr().lock(), &text)?,
        }
        Ok(())
    }
}

fn print(mut out: impl io::Write, text: &str) -> io::Result<()> {
    out.write_all(text.as_bytes()).and_then(|()| out.flush())
}

/// Returns text with the control characters of a terminal escaped.
pub fn shown(text: &str) -> String {
    text.split('\n').map(escaped).collect::<Vec<_>>().join("\n")
}

/// Returns JSON in which the control characters of a terminal are escaped by the rules of JSON;
/// these characters occur only in strings.
fn shown_json(json: &str) -> String {
    let mut shown = String::with_capacity(json.len());
    for c in json.chars() {
        let raw = c.encode_utf8(&mut [0; 4]).to_owned();
        if c == '\n' || escaped(&raw) == raw {
            shown.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            let _ = write!(shown, "\\u{unit:04x}");
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_from_a_file_moves_the_cursor() {
        assert_eq!(shown("a\u{1b}[2J\nb\u{202e}c µN"), "a\\u{1b}[2J\nb\\u{202e}c µN");
        let json = serde_json::to_string_pretty(&["x\u{202e}\u{9b}µ", "y"]).unwrap();
        let shown = shown_json(&json);
        assert!(shown.contains("\\u202e\\u009bµ"), "{shown}");
        let read: Vec<String> = serde_json::from_str(&shown).unwrap();
        assert_eq!(read, ["x\u{202e}\u{9b}µ", "y"]);
    }
}
