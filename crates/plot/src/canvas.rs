//! SVG canvas with the few shapes that figures and sketches need.

use std::fmt::Write as _;

use crate::style::{Color, Dash};
use crate::text::{FAMILY, Level, SCRIPT_SIZE, Weight, runs, text_width};

/// Point on the canvas, in px from the top left corner.
pub type Point = (f64, f64);

/// Stroke of a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Colour.
    pub color: Color,
    /// Width, px.
    pub width: f64,
    /// Pattern.
    pub dash: Dash,
}

impl Stroke {
    /// A solid stroke of this width, px.
    pub const fn solid(color: Color, width: f64) -> Self {
        Stroke { color, width, dash: Dash::Solid }
    }
}

/// Alignment of a text with its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Anchor {
    /// The text starts at its point.
    Start,
    /// The text is centred at its point.
    #[default]
    Middle,
    /// The text ends at its point.
    End,
}

/// Style of a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TextStyle {
    /// Font size, px.
    pub size: f64,
    /// Weight.
    pub weight: Weight,
    /// `true` for italics, as for variables.
    pub italic: bool,
    /// Colour.
    pub color: Color,
    /// Alignment of the text with its point.
    pub anchor: Anchor,
    /// `true` for text rotated by 90° to the left.
    pub vertical: bool,
}

impl TextStyle {
    /// Creates the style of dark, upright, centred text of this size, px.
    pub const fn new(size: f64) -> Self {
        TextStyle {
            size,
            weight: Weight::Regular,
            italic: false,
            color: Color::DARK,
            anchor: Anchor::Middle,
            vertical: false,
        }
    }

    /// Returns the style with another anchor.
    pub const fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// Returns the style in another colour.
    pub const fn colored(mut self, color: Color) -> Self {
        self.color = color;
        self
    }

    /// Returns the style in bold.
    pub const fn bold(mut self) -> Self {
        self.weight = Weight::Bold;
        self
    }

    /// Returns the style in italics.
    pub const fn italic(mut self) -> Self {
        self.italic = true;
        self
    }
}

/// SVG document under construction.
///
/// Coordinates are written with two decimals, so the same drawing is the same text on every
/// machine.
///
/// ```
/// use mechid_plot::{Canvas, Color, Stroke, TextStyle};
///
/// let mut sheet = Canvas::new(200.0, 80.0);
/// let stroke = Stroke::solid(Color::BLACK, 1.0);
/// sheet.rect((20.0, 20.0), (160.0, 40.0), Some(Color::WHITE), Some(stroke));
/// sheet.text((100.0, 45.0), "M < 10 kg", &TextStyle::new(14.0));
/// let svg = sheet.finish("A box");
/// assert!(svg.contains("M &lt; 10 kg"));
/// ```
#[derive(Debug, Clone)]
pub struct Canvas {
    width: f64,
    height: f64,
    body: String,
    clips: usize,
    /// Prefix of the ids in this document.
    ids: String,
    /// `true` for a drawing that screen readers skip.
    is_decorative: bool,
}

impl Canvas {
    /// Creates an empty white canvas, px.
    pub fn new(width: f64, height: f64) -> Self {
        let mut sheet = Canvas {
            width,
            height,
            body: String::new(),
            clips: 0,
            ids: String::new(),
            is_decorative: false,
        };
        sheet.rect((0.0, 0.0), (width, height), Some(Color::WHITE), None);
        sheet
    }

    /// Returns the canvas with ids that begin with `ids` (letters, digits, `-`, `_`; other
    /// characters become `-`), so that several canvases can be in one document.
    #[must_use]
    pub fn with_ids(mut self, ids: &str) -> Self {
        let safe = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
        self.ids = ids.chars().map(safe).collect();
        self
    }

    /// Returns the canvas as a decorative drawing: without a title, and skipped by screen readers.
    pub(crate) fn decorative(mut self) -> Self {
        self.is_decorative = true;
        self
    }

    /// Draws dots of one diameter, in px, and one colour, as one path.
    pub(crate) fn dots(&mut self, centers: &[Point], diameter: f64, color: Color) {
        let mut path = String::with_capacity(centers.len() * 12);
        for (x, y) in centers {
            // Some renderers draw no round ends on a line of length zero.
            let _ = write!(path, "M{} {}h.01", num(*x), num(*y));
        }
        let (width, color) = (num(diameter), color.0);
        let _ = writeln!(
            self.body,
            r#"<path d="{path}" fill="none" stroke="{color}" stroke-width="{width}" stroke-linecap="round"/>"#
        );
    }

    /// Draws a straight line.
    pub fn line(&mut self, from: Point, to: Point, stroke: Stroke) {
        self.path(
            &format!("M{} {}L{} {}", num(from.0), num(from.1), num(to.0), num(to.1)),
            None,
            Some(stroke),
        );
    }

    /// Draws separate straight lines as one path, so that the file stays small with hundreds of
    /// them.
    pub fn segments(&mut self, all: impl IntoIterator<Item = (Point, Point)>, stroke: Stroke) {
        let path: String = all.into_iter().map(|(from, to)| chain(&[from, to])).collect();
        if !path.is_empty() {
            self.path(&path, None, Some(stroke));
        }
    }

    /// Draws discs of one radius, in px, and one colour, which is written once.
    pub fn discs(&mut self, centers: &[Point], radius: f64, color: Color) {
        let _ = writeln!(self.body, "<g{}>", paint(Some(color), None));
        let r = num(radius);
        for (x, y) in centers {
            let (x, y) = (num(*x), num(*y));
            let _ = writeln!(self.body, r#"<circle cx="{x}" cy="{y}" r="{r}"/>"#);
        }
        self.close_group();
    }

    /// Draws connected straight lines.
    pub fn polyline(&mut self, points: &[Point], stroke: Stroke) {
        self.path(&chain(points), None, Some(stroke));
    }

    /// Draws closed connected straight lines.
    pub fn polygon(&mut self, points: &[Point], fill: Option<Color>, stroke: Option<Stroke>) {
        self.path(&(chain(points) + "Z"), fill, stroke);
    }

    /// Draws a rectangle from its top left corner and its size.
    pub fn rect(
        &mut self,
        corner: Point,
        size: Point,
        fill: Option<Color>,
        stroke: Option<Stroke>,
    ) {
        let (x, y, w, h) = (num(corner.0), num(corner.1), num(size.0), num(size.1));
        let paint = paint(fill, stroke);
        let _ = writeln!(self.body, r#"<rect x="{x}" y="{y}" width="{w}" height="{h}"{paint}/>"#);
    }

    /// Draws a circle; centre and radius in px.
    pub fn circle(
        &mut self,
        center: Point,
        radius: f64,
        fill: Option<Color>,
        stroke: Option<Stroke>,
    ) {
        let (x, y, r) = (num(center.0), num(center.1), num(radius));
        let paint = paint(fill, stroke);
        let _ = writeln!(self.body, r#"<circle cx="{x}" cy="{y}" r="{r}"{paint}/>"#);
    }

    /// Draws a path in the path language of SVG.
    pub fn path(&mut self, data: &str, fill: Option<Color>, stroke: Option<Stroke>) {
        let paint = paint(fill, stroke);
        let _ = writeln!(self.body, r#"<path d="{data}"{paint}/>"#);
    }

    /// Draws a line of text with its baseline at the point; `^{…}` is a superscript and `_{…}` a
    /// subscript, as in `10^{−3}` and `K_{xx}`.
    pub fn text(&mut self, at: Point, text: &str, style: &TextStyle) {
        let (x, y) = (num(at.0), num(at.1));
        let anchor = match style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let _ = write!(
            self.body,
            r#"<text x="{x}" y="{y}" font-size="{}" text-anchor="{anchor}" fill="{}""#,
            num(style.size),
            style.color.0
        );
        if style.weight == Weight::Bold {
            self.body.push_str(r#" font-weight="bold""#);
        }
        // The length of a text is written only if it is reliable and needed. It is not reliable for
        // italics, which are not measured, and for superscripts and subscripts, which renderers
        // draw differently. It is not needed for a text of one or two characters.
        let plain = !style.italic && runs(text).len() == 1;
        if plain && text.chars().nth(2).is_some() {
            let length = num(text_width(text, style.size, style.weight));
            let _ = write!(self.body, r#" textLength="{length}" lengthAdjust="spacingAndGlyphs""#);
        }
        if style.italic {
            self.body.push_str(r#" font-style="italic""#);
        }
        if style.vertical {
            let _ = write!(self.body, r#" transform="rotate(-90 {x} {y})""#);
        }
        let _ = writeln!(self.body, ">{}</text>", spans(text, style.size));
    }

    /// Opens a group with a class and a name, which a viewer shows as a tool tip.
    pub fn open_group(&mut self, class: &str, name: &str) {
        let _ = writeln!(
            self.body,
            r#"<g class="{}"><title>{}</title>"#,
            escape(class),
            escape(&unmarked(name))
        );
    }

    /// Opens a group that is drawn with this opacity, a fraction from 0 to 1.
    pub fn open_faded(&mut self, opacity: f64) {
        let _ = writeln!(self.body, r#"<g opacity="{}">"#, num(opacity));
    }

    /// Opens a group that is clipped to a rectangle.
    pub fn open_clip(&mut self, corner: Point, size: Point) {
        let id = format!("{}clip{}", self.ids, self.clips);
        self.clips += 1;
        let (x, y, w, h) = (num(corner.0), num(corner.1), num(size.0), num(size.1));
        let _ = writeln!(
            self.body,
            r#"<clipPath id="{id}"><rect x="{x}" y="{y}" width="{w}" height="{h}"/></clipPath><g clip-path="url(#{id})">"#
        );
    }

    /// Closes the most recently opened group.
    pub fn close_group(&mut self) {
        self.body.push_str("</g>\n");
    }

    /// Returns the document, with a title for screen readers.
    pub fn finish(self, title: &str) -> String {
        let (w, h) = (num(self.width), num(self.height));
        if self.is_decorative {
            return format!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {w} {h}" aria-hidden="true">{}</svg>"#,
                self.body.replace('\n', "")
            );
        }
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{w}" height="{h}" viewBox="0 0 {w} {h}" font-family="{FAMILY}" role="img"><title>{}</title>
{}</svg>
"#,
            escape(&unmarked(title)),
            self.body
        )
    }
}

fn chain(points: &[Point]) -> String {
    let mut data = String::with_capacity(points.len() * 14);
    for (index, point) in points.iter().enumerate() {
        data.push(if index == 0 { 'M' } else { 'L' });
        let _ = write!(data, "{} {}", num(point.0), num(point.1));
    }
    data
}

fn paint(fill: Option<Color>, stroke: Option<Stroke>) -> String {
    let mut out = format!(r#" fill="{}""#, fill.map_or("none", |color| color.0));
    if let Some(stroke) = stroke {
        let _ = write!(
            out,
            r#" stroke="{}" stroke-width="{}" stroke-linejoin="round""#,
            stroke.color.0,
            num(stroke.width)
        );
        if let Some(array) = stroke.dash.array(stroke.width) {
            let parts: Vec<String> = array.into_iter().map(num).collect();
            let _ = write!(out, r#" stroke-dasharray="{}""#, parts.join(" "));
        }
    }
    out
}

/// Returns the SVG spans of a text. Superscripts and subscripts are shifted with the attribute
/// `dy`, which every viewer supports.
fn spans(text: &str, size: f64) -> String {
    let mut out = String::new();
    let mut height = 0.0;
    for (level, run) in runs(text) {
        let target = match level {
            Level::Base => 0.0,
            Level::Raised => 0.36 * size,
            Level::Lowered => -0.22 * size,
        };
        if level == Level::Base && height == 0.0 {
            out.push_str(&escape(run));
            continue;
        }
        let dy = num(height - target);
        let small = if level == Level::Base {
            String::new()
        } else {
            format!(r#" font-size="{}""#, num(SCRIPT_SIZE * size))
        };
        let _ = write!(out, r#"<tspan dy="{dy}"{small}>{}</tspan>"#, escape(run));
        height = target;
    }
    out
}

/// Returns a coordinate with at most two decimals, which is finer than the resolution of print.
fn num(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    // Adding zero converts −0 to 0, because Display would write "-0".
    format!("{}", rounded + 0.0)
}

/// Returns the text without superscript and subscript marks, for titles.
fn unmarked(text: &str) -> String {
    runs(text).into_iter().map(|(_, run)| run).collect()
}

pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // XML 1.0 cannot represent most control characters, so each is replaced by a space.
            control if control.is_control() => out.push(' '),
            other => out.push(other),
        }
    }
    out
}
