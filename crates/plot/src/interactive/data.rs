//! Data for the script: axes, curves and numbers of figures, as JSON.

use serde::Serialize;

use super::arrays::Arrays;
use crate::axis::{Axis, Mapping, Scale};
use crate::curve::{Curve, Kind, Reference};
use crate::figure::Figure;
use crate::layout::{Layout, PanelLayout};
use crate::panel::{Panel, ResponsePart};
use crate::style::{Marker, Resolved};
use crate::trace;

/// Maximum number of points of a curve for which every point is written: more than a screen shows,
/// and more than the lines of a response in most tests. If a record is longer, only its extremes
/// are written.
const POINTS: usize = 8192;

/// Number of columns of a thinned record; each has its first, lowest, highest and last point.
const COLUMNS: f64 = 1024.0;

/// Radius of a marker of a thinned cloud, in columns.
const CLOUD: f64 = 2.0;

#[derive(Serialize)]
struct Data<'a> {
    #[serde(rename = "w")]
    width: f64,
    /// Figures; one of them is shown.
    #[serde(rename = "v")]
    views: Vec<View<'a>>,
    #[serde(rename = "a")]
    arrays: Vec<String>,
}

#[derive(Serialize)]
struct View<'a> {
    #[serde(rename = "n")]
    name: &'a str,
    #[serde(rename = "c")]
    columns: usize,
    #[serde(rename = "s")]
    shares_x: bool,
    #[serde(rename = "p")]
    panels: Vec<PanelData<'a>>,
}

#[derive(Serialize)]
struct PanelData<'a> {
    #[serde(rename = "t")]
    title: &'a str,
    /// Height of the frame, px.
    #[serde(rename = "h")]
    height: f64,
    x: AxisData<'a>,
    y: AxisData<'a>,
    #[serde(rename = "q", skip_serializing_if = "Option::is_none")]
    part: Option<&'static str>,
    #[serde(rename = "c")]
    curves: Vec<CurveData<'a>>,
    #[serde(rename = "f", skip_serializing_if = "Vec::is_empty")]
    references: Vec<ReferenceData<'a>>,
}

#[derive(Serialize)]
struct AxisData<'a> {
    #[serde(rename = "l")]
    label: &'a str,
    #[serde(rename = "u")]
    unit: &'a str,
    #[serde(rename = "g")]
    is_logarithmic: bool,
    #[serde(rename = "r")]
    range: (f64, f64),
    #[serde(rename = "s", skip_serializing_if = "Option::is_none")]
    step: Option<f64>,
}

#[derive(Serialize)]
struct CurveData<'a> {
    #[serde(rename = "n", skip_serializing_if = "str::is_empty")]
    label: &'a str,
    #[serde(rename = "k")]
    kind: &'static str,
    x: Option<usize>,
    y: Option<usize>,
    /// Upper edge of a band.
    #[serde(rename = "u", skip_serializing_if = "Option::is_none")]
    upper: Option<usize>,
    #[serde(rename = "p", skip_serializing_if = "Option::is_none")]
    phase_deg: Option<usize>,
    #[serde(rename = "e", skip_serializing_if = "Option::is_none")]
    error: Option<usize>,
    #[serde(rename = "i", skip_serializing_if = "<[String]>::is_empty")]
    notes: &'a [String],
    #[serde(rename = "o")]
    color: &'static str,
    #[serde(rename = "w")]
    width: f64,
    #[serde(rename = "d", skip_serializing_if = "Option::is_none")]
    dash: Option<Vec<f64>>,
    #[serde(rename = "m", skip_serializing_if = "Option::is_none")]
    marker: Option<&'static str>,
    /// Number of points before thinning; `None` if the curve is not thinned.
    #[serde(rename = "of", skip_serializing_if = "Option::is_none")]
    len_before_thinning: Option<usize>,
}

#[derive(Serialize)]
struct ReferenceData<'a> {
    #[serde(rename = "n", skip_serializing_if = "str::is_empty")]
    label: &'a str,
    #[serde(rename = "v")]
    value: f64,
    #[serde(rename = "h")]
    is_horizontal: bool,
    #[serde(rename = "o")]
    color: &'static str,
    #[serde(rename = "d", skip_serializing_if = "Option::is_none")]
    dash: Option<Vec<f64>>,
}

/// Returns the JSON of named figures with their layouts.
pub(super) fn json(members: &[(String, Figure)], layouts: &[Layout]) -> String {
    let mut arrays = Arrays::default();
    let views = members.iter().zip(layouts).map(|((name, figure), layout)| View {
        name,
        columns: figure.columns.min(figure.panels.len()),
        shares_x: figure.share_x,
        panels: figure
            .panels
            .iter()
            .zip(&layout.panels)
            .enumerate()
            .map(|(at, (panel, layout))| {
                let title = if at == 0 && panel.title.is_empty() { name } else { &panel.title };
                panel_data(panel, title, layout, &mut arrays)
            })
            .collect(),
    });
    let views: Vec<View<'_>> = views.collect();
    let width = layouts.first().map_or(0.0, |layout| layout.size.0);
    // Numbers and texts can always be serialised.
    serde_json::to_string(&Data { width, views, arrays: arrays.into_texts() }).unwrap_or_default()
}

fn panel_data<'a>(
    panel: &'a Panel,
    title: &'a str,
    layout: &PanelLayout,
    arrays: &mut Arrays,
) -> PanelData<'a> {
    // The curves of the magnitude contain the phase as well, so the phase panel needs no curves of
    // its own.
    let has_phase = |curve: &Curve| !curve.phase_deg.is_empty();
    let part = match panel.part {
        Some(ResponsePart::Magnitude) if panel.curves.iter().any(has_phase) => Some("m"),
        Some(ResponsePart::Phase) => Some("p"),
        _ => None,
    };
    let curves = match part {
        Some("p") => Vec::new(),
        _ => panel
            .curves
            .iter()
            .zip(panel.styles())
            .map(|(curve, style)| curve_data(panel, curve, style, layout, arrays))
            .collect(),
    };
    PanelData {
        title,
        height: layout.size.1.round(),
        x: axis_data(&panel.x, layout.x_range),
        y: axis_data(&panel.y, layout.y_range),
        part,
        curves,
        references: panel.references.iter().map(reference_data).collect(),
    }
}

fn axis_data(axis: &Axis, range: (f64, f64)) -> AxisData<'_> {
    AxisData {
        label: &axis.label,
        unit: &axis.unit,
        is_logarithmic: axis.scale == Scale::Log10,
        range,
        step: axis.step,
    }
}

fn reference_data(reference: &Reference) -> ReferenceData<'_> {
    ReferenceData {
        label: &reference.label,
        value: reference.value,
        is_horizontal: reference.horizontal,
        color: reference.color.0,
        dash: reference.dash.array(1.1),
    }
}

fn curve_data<'a>(
    panel: &Panel,
    curve: &'a Curve,
    style: Resolved,
    layout: &PanelLayout,
    arrays: &mut Arrays,
) -> CurveData<'a> {
    let thinned = (curve.x.len() > POINTS && curve.notes.is_empty() && curve.phase_deg.is_empty())
        .then(|| thin(panel, curve, layout));
    let (x, y, upper) = match &thinned {
        Some([x, y, upper]) => (x, y, upper),
        None => (&curve.x, &curve.y, &curve.upper),
    };
    CurveData {
        label: &curve.label,
        kind: match curve.kind {
            Kind::Line => "l",
            Kind::MarkedLine => "k",
            Kind::Points => "p",
            Kind::Stems => "s",
            Kind::Band => "b",
        },
        x: arrays.add(x),
        y: arrays.add(y),
        upper: arrays.add(upper),
        phase_deg: arrays.add_phase(&curve.phase_deg),
        error: if thinned.is_some() { None } else { arrays.add_rough(&curve.error) },
        notes: &curve.notes,
        color: style.color.0,
        width: style.width,
        dash: if curve.has_line() { style.dash.array(style.width) } else { None },
        marker: curve.has_markers().then(|| marker_name(style.marker)),
        len_before_thinning: thinned.is_some().then_some(curve.x.len()),
    }
}

fn marker_name(marker: Marker) -> &'static str {
    match marker {
        Marker::Circle => "c",
        Marker::Square => "s",
        Marker::Triangle => "t",
        Marker::Diamond => "d",
        Marker::TriangleDown => "v",
        Marker::Cross => "x",
        Marker::Plus => "p",
    }
}

/// Returns abscissae, ordinates and upper edge of a long record, reduced to the points that a
/// screen can show.
fn thin(panel: &Panel, curve: &Curve, layout: &PanelLayout) -> [Vec<f64>; 3] {
    let (low, high) = layout.x_range;
    let across = Mapping::new(panel.x.scale, (low, high), (0.0, COLUMNS));
    let is_cloud = curve.x.windows(2).any(|pair| pair[1] < pair[0]);
    if is_cloud {
        let down = Mapping::new(panel.y.scale, layout.y_range, (0.0, COLUMNS));
        let maps = trace::Mappings { x: across, y: down };
        let points = trace::map(maps, &curve.x, &curve.y);
        let indices = trace::thinned_indices(&points, CLOUD);
        let pick =
            |values: &[f64]| indices.iter().filter_map(|k| values.get(*k).copied()).collect();
        return [pick(&curve.x), pick(&curve.y), pick(&curve.upper)];
    }
    let mut retained = Vec::new();
    let indices: Vec<usize> = (0..curve.x.len()).collect();
    let column = |k: &usize| across.pixel(curve.x[*k]).floor();
    for of_column in indices.chunk_by(|a, b| column(a) == column(b)) {
        let first = of_column[0];
        let by = |values: &'_ [f64], k: &usize| values.get(*k).copied().unwrap_or(0.0);
        let lowest = of_column.iter().min_by(|a, b| by(&curve.y, a).total_cmp(&by(&curve.y, b)));
        let top = if curve.upper.is_empty() { &curve.y } else { &curve.upper };
        let highest = of_column.iter().max_by(|a, b| by(top, a).total_cmp(&by(top, b)));
        let mut of_column = [
            first,
            lowest.copied().unwrap_or(first),
            highest.copied().unwrap_or(first),
            of_column[of_column.len() - 1],
        ];
        of_column.sort_unstable();
        retained.extend_from_slice(&of_column);
    }
    retained.dedup();
    let pick = |values: &[f64]| retained.iter().filter_map(|k| values.get(*k).copied()).collect();
    [pick(&curve.x), pick(&curve.y), pick(&curve.upper)]
}
