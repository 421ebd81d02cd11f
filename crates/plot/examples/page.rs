//! Writes interactive pages of a response and of the shapes of a frame into the given folder
//! (default: the current one).
#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;
use std::path::PathBuf;

use mechid_plot::charts::{FrequencyResponse, bode};
use mechid_plot::{Axis, DrawnMode, ShapeDrawing, page_of};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("."), PathBuf::from);
    // The machine is a mass of 10 kg on a spring of 5,000 N/m and a damper of 18 N·s/m.
    let response = |hz: f64| {
        let omega = TAU * hz;
        let (re, im) = (5000.0 - 10.0 * omega * omega, 18.0 * omega);
        (1.0 / re.hypot(im), -im.atan2(re).to_degrees())
    };
    let hz: Vec<f64> = (1..=400).map(|k| 0.025 * f64::from(k)).collect();
    let (magnitude, phase_deg): (Vec<f64>, Vec<f64>) = hz.iter().map(|hz| response(*hz)).unzip();
    let standard_error: Vec<f64> = magnitude.iter().map(|m| 0.05 * m).collect();
    let exact = FrequencyResponse {
        name: "exact",
        frequency: &hz,
        magnitude: &magnitude,
        phase_deg: &phase_deg,
        standard_error: &[],
    };
    let measured = FrequencyResponse { name: "measured", standard_error: &standard_error, ..exact };
    let axes = (Axis::linear("Frequency", "Hz"), Axis::log10("Receptance", "m/N"));
    let figure = bode("Mass on a spring", axes.0, axes.1, &[measured], &[exact]);
    let file = folder.join("response.html");
    std::fs::write(&file, figure.to_html()?)?;
    println!("{}", file.display());

    let corners =
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, 0.0, 1.2], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    let still = [[0.0; 2]; 3];
    let along_x = |re: f64, im: f64| [[re, im], [0.0; 2], [0.0; 2]];
    let mode = |name: &str, moved: [[[f64; 2]; 3]; 3]| DrawnMode {
        name: name.to_owned(),
        short_name: name.to_owned(),
        displacement: [[still].as_slice(), moved.as_slice(), [still].as_slice()].concat(),
    };
    let frame = ShapeDrawing {
        points: (1..).zip(corners).map(|(number, at)| (format!("{number}"), at)).collect(),
        lines: (1..corners.len()).map(|k| [k - 1, k]).collect(),
        modes: vec![
            mode("sway, 12.4 Hz", [along_x(1.0, 0.0), along_x(1.1, 0.0), along_x(1.0, 0.0)]),
            mode("travelling, 55.5 Hz", [along_x(1.0, 0.0), along_x(0.0, 1.0), along_x(-1.0, 0.0)]),
        ],
    };
    let file = folder.join("shapes.html");
    std::fs::write(&file, page_of("Shapes of a frame", &[frame.draw("Shapes of a frame")]))?;
    println!("{}", file.display());
    Ok(())
}
