//! Interactive figures: their numbers in the SVG, the script that zooms in them, and pages of one
//! figure.

mod arrays;
mod data;
mod html;
mod squeeze;
mod thumbnail;

use crate::error::PlotError;
use crate::figure::Figure;
use crate::layout::Layout;

pub use self::html::{content_policy, figure_style, script};

/// Figures of one kind that are shown one at a time, such as the responses of a matrix.
///
/// ```
/// use mechid_plot::{Axis, Curve, Figure, FigureSet, Panel};
///
/// let one = |y: [f64; 2]| {
///     let panel = Panel::new(Axis::linear("Time", "s"), Axis::linear("x", "m"));
///     Figure::new("").panel(panel.curve(Curve::line("", &[0.0, 1.0], &y)))
/// };
/// let [x1, x2] = [one([0.0, 1.0]), one([1.0, 0.0])];
/// let set = FigureSet::new([("x1".to_owned(), x1), ("x2".to_owned(), x2)]);
/// let drawn = set.draw("shapes", "Two displacements")?;
/// assert_eq!(drawn.map.len(), 2);
/// assert!(drawn.svg.contains("<metadata>"));
/// # Ok::<(), mechid_plot::PlotError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct FigureSet {
    members: Vec<(String, Figure)>,
}

/// Drawn set of figures: the first figure, with the numbers of all figures, and a small drawing of
/// each figure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DrawnSet {
    /// SVG of the first figure, with the numbers of all figures in an element `metadata`.
    pub svg: String,
    /// Name and small SVG of each figure, in order; empty if there is only one figure.
    pub map: Vec<(String, String)>,
}

impl FigureSet {
    /// Creates a set of named figures; the first one is shown at first.
    pub fn new(members: impl IntoIterator<Item = (String, Figure)>) -> Self {
        Self { members: members.into_iter().collect() }
    }

    /// Returns the named figures in order.
    pub fn members(&self) -> &[(String, Figure)] {
        &self.members
    }

    /// Draws the set for an HTML document with several sets: its ids begin with `ids`, which must
    /// be different for each set, and `label` is its name for screen readers.
    ///
    /// # Errors
    /// [`PlotError::NoPanels`] if the set has no figures; otherwise the errors of
    /// [`Figure::to_svg`] for each figure.
    pub fn draw(&self, ids: &str, label: &str) -> Result<DrawnSet, PlotError> {
        let Some((_, first)) = self.members.first() else {
            return Err(PlotError::NoPanels { figure: label.to_owned() });
        };
        let svg = first.to_inline_svg(ids, label)?;
        let layouts = self.members.iter().map(|(_, figure)| {
            figure.validate()?;
            Layout::new(figure)
        });
        let layouts: Vec<Layout> = layouts.collect::<Result<_, PlotError>>()?;
        let json = data::json(&self.members, &layouts);
        let map = match self.members.len() {
            1 => Vec::new(),
            _ => self
                .members
                .iter()
                .zip(&layouts)
                .map(|((name, figure), layout)| (name.clone(), thumbnail::svg(figure, layout)))
                .collect(),
        };
        Ok(DrawnSet { svg: with_metadata(&svg, &json), map })
    }
}

impl DrawnSet {
    /// Returns the drawing, with the small drawings to choose from, as elements of an HTML
    /// document.
    pub fn html(&self) -> String {
        let button = |(name, svg): &(String, String)| {
            format!("<button type=\"button\">{svg}{}</button>", crate::canvas::escape(name))
        };
        let buttons: String = self.map.iter().map(button).collect();
        if buttons.is_empty() {
            self.svg.clone()
        } else {
            format!("{}<div class=\"map\">{buttons}</div>", self.svg)
        }
    }
}

/// Returns an HTML page of drawings below one another. The page has zoom and cursor, and loads no
/// other file.
pub fn page_of(title: &str, drawings: &[DrawnSet]) -> String {
    let figures: String = drawings
        .iter()
        .map(|drawn| format!("<figure class=\"wide\">{}</figure>", drawn.html()))
        .collect();
    html::page(title, &figures)
}

impl Figure {
    /// Returns the figure as [`Figure::to_inline_svg`] does, with its numbers for the [`script()`]
    /// that makes it interactive.
    ///
    /// # Errors
    /// As [`Figure::to_svg`].
    pub fn to_interactive_svg(&self, ids: &str, label: &str) -> Result<String, PlotError> {
        Ok(FigureSet::new([(String::new(), self.clone())]).draw(ids, label)?.svg)
    }

    /// Returns an HTML page of the figure, which has zoom and cursor and loads no other file.
    ///
    /// # Errors
    /// As [`Figure::to_svg`].
    pub fn to_html(&self) -> Result<String, PlotError> {
        let set = FigureSet::new([(String::new(), self.clone().titled(""))]);
        Ok(page_of(&self.title, &[set.draw("figure", &self.title)?]))
    }
}

/// Inserts an element `metadata` with the JSON for the script after the title of an SVG document;
/// the special characters of XML are escaped.
pub fn with_metadata(svg: &str, json: &str) -> String {
    let text = crate::canvas::escape(json);
    svg.replacen("</title>", &format!("</title><metadata>{text}</metadata>"), 1)
}
