//! Positions of all parts of a figure.

use crate::axis::{Mapping, TINY};
use crate::canvas::Point;
use crate::error::PlotError;
use crate::figure::Figure;
use crate::legend::{self, Entry};
use crate::panel::{Legend, Panel};
use crate::style::{LABEL_SIZE, TICK_SIZE};
use crate::text::{Weight, text_width};
use crate::ticks::{Ticks, ticks};
use crate::trace::{self, Mappings, Segment};

/// Maximum width or height of a figure, px; in a larger figure, the pixels per unit of a short axis
/// would overflow.
const LARGEST: f64 = 1e9;

/// Length of a tick, px.
pub(crate) const TICK: f64 = 4.0;
/// Distance of the label from its tick, px.
const TICK_GAP: f64 = 4.0;
/// Margin of the figure, px.
const EDGE: f64 = 10.0;
/// Height of the title of the figure, px.
const TITLE: f64 = 28.0;
/// Height of the title of a panel, px.
const PANEL_TITLE: f64 = 21.0;
/// Height of the text of the common factor of the tick labels, such as ×10⁻³, px.
const FACTOR: f64 = 15.0;
/// Height of the caption of an axis, px.
const CAPTION: f64 = LABEL_SIZE + 9.0;
/// Distance between panels, px.
const BETWEEN: f64 = 16.0;
/// Minimum size of the frame of a panel that is legible, px.
const LEAST_FRAME: Point = (60.0, 40.0);

/// Position of the legend of one panel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Place {
    Nowhere,
    Inside(Point),
    Above,
}

/// Panel with its frame and its axes.
#[derive(Debug, Clone)]
pub(crate) struct PanelLayout {
    pub(crate) corner: Point,
    pub(crate) size: Point,
    pub(crate) maps: Mappings,
    pub(crate) x_range: (f64, f64),
    pub(crate) y_range: (f64, f64),
    pub(crate) x_ticks: Ticks,
    pub(crate) y_ticks: Ticks,
    /// `true` if ticks and caption of the abscissa are written under this panel.
    pub(crate) labels_x: bool,
    /// `true` if the title of the panel is written above it.
    pub(crate) titled: bool,
    /// Abscissa of the centre line of the ordinate's caption, px.
    pub(crate) y_caption_x: f64,
    pub(crate) entries: Vec<Entry>,
    pub(crate) place: Place,
}

/// Size of a figure, and positions of its panels and of its shared legend.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) size: Point,
    pub(crate) panels: Vec<PanelLayout>,
    /// Entries of the shared legend, and its vertical position.
    pub(crate) strip: Vec<Entry>,
    pub(crate) strip_top: f64,
}

/// Margins of a row or a column around its frames.
#[derive(Debug, Clone, Copy, Default)]
struct Margins {
    before: f64,
    after: f64,
}

impl Layout {
    pub(crate) fn new(figure: &Figure) -> Result<Self, PlotError> {
        let planner = Planner::new(figure)?;
        let first = planner.arrange(&vec![false; figure.panels.len()])?;
        // A legend without a free position inside its panel is drawn above the panel; this moves
        // every frame of the row.
        let above: Vec<bool> =
            first.panels.iter().map(|panel| panel.place == Place::Above).collect();
        if above.contains(&true) { planner.arrange(&above) } else { Ok(first) }
    }
}

/// Lowest and highest value on each axis of a panel.
#[derive(Debug, Clone, Copy)]
struct Ranges {
    x: (f64, f64),
    y: (f64, f64),
}

struct Planner<'a> {
    figure: &'a Figure,
    size: Point,
    columns: usize,
    rows: usize,
    ranges: Vec<Ranges>,
    strip: Vec<Entry>,
}

impl<'a> Planner<'a> {
    fn new(figure: &'a Figure) -> Result<Self, PlotError> {
        let columns = figure.columns.min(figure.panels.len());
        let rows = figure.panels.len().div_ceil(columns);
        let strip =
            if figure.shared_legend { legend::union(figure.panels.iter()) } else { Vec::new() };
        let size = figure.size.unwrap_or_else(|| {
            let width = if columns == 1 { 720.0 } else { 480.0 * columns as f64 };
            let height = if rows == 1 { 430.0 } else { 270.0 * rows as f64 };
            let title = if figure.title.is_empty() { 0.0 } else { TITLE };
            (width, height + title + legend::strip_height(&strip, width - 2.0 * EDGE))
        });
        let ranges = ranges(figure, columns)?;
        if !(size.0 <= LARGEST && size.1 <= LARGEST) {
            let (width, height) = size;
            let (needed_width, needed_height) = LEAST_FRAME;
            return Err(PlotError::Size { width, height, needed_width, needed_height });
        }
        Ok(Planner { figure, size, columns, rows, ranges, strip })
    }

    fn too_small(&self, needed: Point) -> PlotError {
        PlotError::Size {
            width: self.size.0,
            height: self.size.1,
            needed_width: needed.0,
            needed_height: needed.1,
        }
    }

    /// Returns whether the abscissa of a panel is labelled: with shared abscissae, only the lowest
    /// of a column.
    fn labels_x(&self, index: usize) -> bool {
        !self.figure.share_x || index + self.columns >= self.figure.panels.len()
    }

    /// Returns whether the title of a panel is written; it is omitted if the panel above has the
    /// same title.
    fn titled(&self, index: usize) -> bool {
        let title = |index: usize| &self.figure.panels[index].title;
        let repeated = self.figure.share_x
            && index >= self.columns
            && title(index) == title(index - self.columns);
        !title(index).is_empty() && !repeated
    }

    fn arrange(&self, above: &[bool]) -> Result<Layout, PlotError> {
        let strip_height = legend::strip_height(&self.strip, self.size.0 - 2.0 * EDGE);
        let strip_top = EDGE + if self.figure.title.is_empty() { 0.0 } else { TITLE };
        let (tops, frame_height) = self.rows(above, strip_top + strip_height)?;
        let y_ticks: Vec<Ticks> = self
            .figure
            .panels
            .iter()
            .zip(&self.ranges)
            .map(|(panel, ranges)| {
                let (low, high) = ranges.y;
                ticks(panel.y.scale, low, high, (frame_height / 42.0).clamp(2.0, 9.0), panel.y.step)
            })
            .collect();
        let (lefts, frame_width, label_widths) = self.columns(&y_ticks)?;
        let panels = y_ticks
            .into_iter()
            .enumerate()
            .map(|(index, y_ticks)| {
                let column = index % self.columns;
                let corner = (lefts[column], tops[index / self.columns]);
                let y_caption_x = corner.0 - TICK - TICK_GAP - label_widths[column] - 10.0;
                self.panel(
                    index,
                    corner,
                    (frame_width, frame_height),
                    y_ticks,
                    y_caption_x,
                    above[index],
                )
            })
            .collect();
        Ok(Layout { size: self.size, panels, strip: self.strip.clone(), strip_top })
    }

    /// Returns the tops of the frames of each row, and their common height.
    fn rows(&self, above: &[bool], top: f64) -> Result<(Vec<f64>, f64), PlotError> {
        let mut margins = vec![Margins::default(); self.rows];
        for (index, panel) in self.figure.panels.iter().enumerate() {
            let needed = self.vertical_margins(index, panel, above[index]);
            let row = &mut margins[index / self.columns];
            row.before = row.before.max(needed.before);
            row.after = row.after.max(needed.after);
        }
        let taken: f64 = margins.iter().map(|row| row.before + row.after).sum();
        let height = (self.size.1 - top - taken - EDGE / 2.0) / self.rows as f64;
        if height.is_nan() || height < LEAST_FRAME.1 {
            let least = self.size.1 + (LEAST_FRAME.1 - height) * self.rows as f64;
            return Err(self.too_small((self.size.0, least)));
        }
        let mut y = top;
        let tops = margins
            .iter()
            .map(|row| {
                let frame = y + row.before;
                y = frame + height + row.after;
                frame
            })
            .collect();
        Ok((tops, height))
    }

    fn vertical_margins(&self, index: usize, panel: &Panel, above: bool) -> Margins {
        let Ranges { x: x_range, y: y_range } = self.ranges[index];
        let has_factor =
            |scale, range: (f64, f64)| ticks(scale, range.0, range.1, 6.0, None).factor.is_some();
        let mut margins = Margins { before: 4.0, after: 8.0 };
        if self.titled(index) {
            margins.before += PANEL_TITLE;
        } else if has_factor(panel.y.scale, y_range) {
            margins.before += FACTOR;
        }
        if above {
            margins.before += legend::strip_height(&legend::entries(panel), self.rough_width());
        }
        if self.labels_x(index) {
            margins.after = TICK + TICK_GAP + TICK_SIZE + 6.0;
            if !panel.x.caption().is_empty() || has_factor(panel.x.scale, x_range) {
                margins.after += CAPTION;
            }
        }
        margins
    }

    /// Returns an estimate of the frame width before the widths of the tick labels are known; only
    /// legends above a panel use it.
    fn rough_width(&self) -> f64 {
        self.size.0 / self.columns as f64 - 90.0
    }

    /// Returns the left edges of the frames of each column, their common width, and the widest tick
    /// label of each column.
    fn columns(&self, y_ticks: &[Ticks]) -> Result<(Vec<f64>, f64, Vec<f64>), PlotError> {
        let mut labels = vec![0.0f64; self.columns];
        let mut captions = vec![0.0f64; self.columns];
        for (index, (panel, ticks)) in self.figure.panels.iter().zip(y_ticks).enumerate() {
            let column = index % self.columns;
            let widths =
                ticks.major.iter().map(|(_, label)| text_width(label, TICK_SIZE, Weight::Regular));
            labels[column] = widths.fold(labels[column], f64::max);
            if !panel.y.caption().is_empty() {
                captions[column] = CAPTION;
            }
        }
        let before: Vec<f64> = labels
            .iter()
            .zip(&captions)
            .map(|(label, caption)| TICK + TICK_GAP + label + caption)
            .collect();
        let taken =
            before.iter().sum::<f64>() + BETWEEN * (self.columns - 1) as f64 + EDGE + 2.0 * EDGE;
        let width = (self.size.0 - taken) / self.columns as f64;
        if width.is_nan() || width < LEAST_FRAME.0 {
            let least = self.size.0 + (LEAST_FRAME.0 - width) * self.columns as f64;
            return Err(self.too_small((least, self.size.1)));
        }
        let mut x = EDGE;
        let lefts = before
            .iter()
            .map(|before| {
                let frame = x + before;
                x = frame + width + BETWEEN;
                frame
            })
            .collect();
        Ok((lefts, width, labels))
    }

    fn panel(
        &self,
        index: usize,
        corner: Point,
        size: Point,
        y_ticks: Ticks,
        y_caption_x: f64,
        above: bool,
    ) -> PanelLayout {
        let panel = &self.figure.panels[index];
        let Ranges { x: x_range, y: y_range } = self.ranges[index];
        let maps = Mappings {
            x: Mapping::new(panel.x.scale, x_range, (corner.0, corner.0 + size.0)),
            y: Mapping::new(panel.y.scale, y_range, (corner.1 + size.1, corner.1)),
        };
        let entries = legend::entries(panel);
        let legend_place = match self.figure.legend_of(panel) {
            _ if entries.is_empty() => Place::Nowhere,
            Legend::Hidden => Place::Nowhere,
            Legend::Above => Place::Above,
            Legend::Auto if above => Place::Above,
            Legend::Auto => {
                let drawn = footprint(panel, maps, corner, size, y_range);
                legend::free_place(corner, size, legend::box_size(&entries), &drawn)
                    .map_or(Place::Above, Place::Inside)
            }
        };
        PanelLayout {
            corner,
            size,
            maps,
            x_range,
            y_range,
            x_ticks: x_ticks(panel, x_range, size.0),
            y_ticks,
            labels_x: self.labels_x(index),
            titled: self.titled(index),
            y_caption_x,
            entries,
            place: legend_place,
        }
    }
}

/// Returns the ranges of abscissa and ordinate of each panel; shared abscissae cover all panels of
/// their column.
fn ranges(figure: &Figure, columns: usize) -> Result<Vec<Ranges>, PlotError> {
    let extents: Vec<(f64, f64)> = figure.panels.iter().map(Panel::x_extent).collect();
    let common = |index: usize| {
        let column = extents.iter().skip(index % columns).step_by(columns);
        column.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), own| {
            (low.min(own.0), high.max(own.1))
        })
    };
    let mut ranges = Vec::with_capacity(figure.panels.len());
    for (index, panel) in figure.panels.iter().enumerate() {
        let column = || figure.panels.iter().skip(index % columns).step_by(columns);
        let (extent, markers) = if figure.share_x {
            (common(index), column().any(Panel::has_markers))
        } else {
            (extents[index], panel.has_markers())
        };
        let (x, y) = (panel.x_range(extent, markers), panel.y_range());
        for (axis, (low, high)) in [(&panel.x, x), (&panel.y, y)] {
            // The range of an axis may have no margin and a length of zero, or an infinite length,
            // if the values are near the limits of f64.
            let length = axis.scale.forward(high) - axis.scale.forward(low);
            if !(length > TINY && length.is_finite()) {
                return Err(PlotError::Range { axis: axis.caption(), low, high });
            }
        }
        ranges.push(Ranges { x, y });
    }
    Ok(ranges)
}

/// Returns the ticks of the abscissa, as many as there is space for their labels.
fn x_ticks(panel: &Panel, (low, high): (f64, f64), width: f64) -> Ticks {
    const AIR: f64 = 14.0;
    let mut wanted = (width / 62.0).clamp(2.0, 12.0);
    loop {
        let ticks = ticks(panel.x.scale, low, high, wanted, panel.x.step);
        let needed: f64 = ticks
            .major
            .iter()
            .map(|(_, label)| text_width(label, TICK_SIZE, Weight::Regular) + AIR)
            .sum();
        if needed <= width || wanted <= 2.0 {
            return ticks;
        }
        wanted -= 1.0;
    }
}

/// Returns the lines and points that a legend must not hide.
fn footprint(
    panel: &Panel,
    maps: Mappings,
    corner: Point,
    size: Point,
    y_range: (f64, f64),
) -> Vec<Segment> {
    let base = trace::stem_base(maps, panel.y.scale, y_range);
    let curves = panel.curves.iter().flat_map(|curve| trace::footprint(curve, maps, base, size.0));
    let references = panel.references.iter().map(|reference| {
        if reference.horizontal {
            let y = maps.y.pixel(reference.value);
            ((corner.0, y), (corner.0 + size.0, y))
        } else {
            let x = maps.x.pixel(reference.value);
            ((x, corner.1), (x, corner.1 + size.1))
        }
    });
    curves.chain(references).collect()
}
