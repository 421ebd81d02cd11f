//! Writes pages with known numbers into the given folder: one response, 28 × 2 responses of 4,096
//! lines, and mode shapes of a frame with a stabilisation diagram. A browser test reads them.

use std::f64::consts::TAU;
use std::fs;
use std::path::PathBuf;

use mechid_analysis::modes::StabilisationRows;
use mechid_io::{Geometry, PointShape};
use mechid_plot::charts::{FrequencyResponse, bode};
use mechid_plot::{Axis, Curve, Figure, Panel};
use mechid_report::{ModeShapes, PageSettings, figure_page, stabilisation};
use nalgebra::Complex;

const LINES: usize = 4096;
const RESPONSES: usize = 28;
const FORCES: usize = 2;

/// Natural frequencies, in Hz, and damping ratios of a beam.
const MODES: [(f64, f64); 5] =
    [(8.0, 0.01), (31.0, 0.008), (70.0, 0.006), (124.0, 0.005), (194.0, 0.005)];

/// Returns the value of a mode shape of a simply supported beam at a position along the beam, from
/// 0 to 1.
fn shape(mode: usize, place: f64) -> f64 {
    ((mode + 1) as f64 * std::f64::consts::PI * place).sin()
}

/// Accelerance of the beam, in 1/kg.
fn accelerance(hz: f64, response: f64, force: f64) -> Complex<f64> {
    let term = |(mode, (natural, damping)): (usize, &(f64, f64))| {
        let r = hz / natural;
        let amplitude = -r * r * shape(mode, response) * shape(mode, force) / 10.0;
        amplitude / Complex::new(1.0 - r * r, 2.0 * damping * r)
    };
    MODES.iter().enumerate().map(term).sum()
}

/// Returns name and figure of a response to a force, with its coherence.
fn response(i: usize, j: usize) -> (String, Figure) {
    let hz: Vec<f64> = (1..=LINES).map(|k| 0.0625 * k as f64).collect();
    let (place, driven) = ((i + 1) as f64 / (RESPONSES + 1) as f64, 0.13 + 0.4 * j as f64);
    let ripple = |k: usize| 1.0 + 0.02 * ((k * 7919 + 31 * i + j) as f64).sin();
    let h: Vec<Complex<f64>> =
        hz.iter().enumerate().map(|(k, hz)| accelerance(*hz, place, driven) * ripple(k)).collect();
    let magnitude: Vec<f64> = h.iter().map(|h| h.norm()).collect();
    let phase_deg: Vec<f64> = h.iter().map(|h| h.arg().to_degrees()).collect();
    let standard_error: Vec<f64> =
        if i == 0 && j == 0 { magnitude.iter().map(|m| 0.02 * m).collect() } else { Vec::new() };
    let measured = FrequencyResponse {
        name: "measured",
        frequency: &hz,
        magnitude: &magnitude,
        phase_deg: &phase_deg,
        standard_error: &standard_error,
    };
    let fine: Vec<f64> = (0..200).map(|k| 0.0625 + 1.28 * f64::from(k)).collect();
    let model: Vec<Complex<f64>> = fine.iter().map(|hz| accelerance(*hz, place, driven)).collect();
    let fitted = FrequencyResponse {
        name: "identified",
        frequency: &fine,
        magnitude: &model.iter().map(|h| h.norm()).collect::<Vec<_>>(),
        phase_deg: &model.iter().map(|h| h.arg().to_degrees()).collect::<Vec<_>>(),
        standard_error: &[],
    };
    let axes = (Axis::linear("Frequency", "Hz"), Axis::log10("Accelerance", "m/(s²·N)"));
    let figure = bode("", axes.0, axes.1, &[measured], &[fitted]);
    let coherence: Vec<f64> =
        (0..LINES).map(|k| 0.98 + 0.02 * ((k * 13 + i) as f64).sin()).collect();
    let panel =
        Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Coherence", "").range(0.0, 1.05));
    let name = format!("a{} / F{}", i + 1, j + 1);
    (
        name,
        if i == 0 && j == 0 {
            figure.panel(panel.curve(Curve::line("", &hz, &coherence)))
        } else {
            figure
        },
    )
}

/// Returns a portal frame of five points with two bending modes and a complex mode, which looks
/// like a travelling wave.
fn frame() -> Result<ModeShapes, Box<dyn std::error::Error>> {
    let table = "1,0,0,0\n2,0,0,1\n3,0.5,0,1.2\n4,1,0,1\n5,1,0,0\nline,1,2,3,4,5\n";
    let geometry = Geometry::parse("frame.csv", table)?;
    let names: Vec<String> = ["2+X", "3+X", "4+X", "3+Z"].map(str::to_owned).to_vec();
    let shapes = [
        (12.4, 0.011, [[1.0, 0.0], [1.1, 0.0], [1.0, 0.0], [0.0, 0.0]]),
        (38.0, 0.008, [[0.2, 0.0], [0.0, 0.0], [-0.2, 0.0], [1.0, 0.0]]),
        (55.5, 0.02, [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.5]]),
    ];
    let mode = |(frequency_hz, damping_ratio, shape): &(f64, f64, [[f64; 2]; 4])| {
        let displacement = geometry.displacement(&names, shape)?;
        Some(PointShape {
            frequency_hz: *frequency_hz,
            damping_ratio: *damping_ratio,
            displacement,
        })
    };
    let modes = shapes.iter().map(mode).collect::<Option<_>>().ok_or("a channel has no point")?;
    Ok(ModeShapes { geometry: geometry.clone(), modes })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("."), PathBuf::from);
    let page = |title: &str, figures, shapes: Option<&ModeShapes>| {
        let title = Some(title.to_owned());
        figure_page(figures, shapes, &PageSettings { title, ..PageSettings::default() })
    };
    fs::write(folder.join("response.html"), page("One response", vec![response(0, 0)], None)?)?;
    let all = (0..FORCES).flat_map(|j| (0..RESPONSES).map(move |i| response(i, j)));
    fs::write(folder.join("matrix.html"), page("28 × 2 responses", all.collect(), None)?)?;
    let hz: Vec<f64> = (1..=600).map(|k| 0.1 * f64::from(k)).collect();
    let resonance = |f: f64, natural: f64, damping: f64| {
        let r = f / natural;
        1.0 / Complex::new(1.0 - r * r, 2.0 * damping * r).norm()
    };
    let sum: Vec<f64> =
        hz.iter().map(|f| resonance(*f, 12.4, 0.011) + 0.3 * resonance(*f, 38.0, 0.008)).collect();
    let mut poles = StabilisationRows::default();
    for order in (2..=320).step_by(2) {
        let wander = 50.0 * (TAU * order as f64 / 7.3).sin().abs() + 5.0;
        for (hz, is_stable) in [(12.4, order > 2), (38.0, order > 6), (wander, false)] {
            poles.order.push(order);
            poles.frequency_hz.push(hz);
            poles.damping_ratio.push(0.01);
            poles.is_stable.push(is_stable);
        }
    }
    let panel = stabilisation(&poles, (&hz, &sum)).ok_or("there are poles")?;
    let diagram = ("Stabilisation".to_owned(), Figure::new("").panel(panel));
    fs::write(folder.join("shapes.html"), page("Frame", vec![diagram], Some(&frame()?))?)?;
    let expected = [known(1599), known(127)];
    fs::write(folder.join("expected.json"), serde_json::to_string(&expected)?)?;
    Ok(())
}

/// Returns the values that the cursor must show at a line of the first response.
fn known(k: usize) -> serde_json::Value {
    serde_json::json!({
        "quantity": "Accelerance",
        "hz": 0.0625 * (k + 1) as f64,
        "step": 0.0625,
        "magnitude": accelerance_of(0, 0, k),
    })
}

/// Magnitude of a measured line, as it is drawn.
fn accelerance_of(i: usize, j: usize, k: usize) -> f64 {
    let place = (i + 1) as f64 / (RESPONSES + 1) as f64;
    let ripple = 1.0 + 0.02 * ((k * 7919 + 31 * i + j) as f64).sin();
    accelerance(0.0625 * (k + 1) as f64, place, 0.13 + 0.4 * j as f64).norm() * ripple
}
