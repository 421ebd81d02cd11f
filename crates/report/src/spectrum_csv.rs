//! The spectrum of a reconstructed force as a table.

use std::fmt::Write as _;

use mechid_analysis::reconstruct::numbered;
use mechid_force::IdentifiedForce;

/// Number of lines whose text is collected before it is returned.
const GATHERED: usize = 1024;

/// Returns the rows of a table in pieces of text: frequency in Hz, then amplitude in N and phase in
/// degrees of each force, for the requested lines (`None`: all).
pub fn spectrum_csv<'a>(
    force: &'a IdentifiedForce,
    lines: Option<&'a [usize]>,
) -> impl Iterator<Item = String> + 'a {
    let spectrum = force.spectrum();
    let dofs = spectrum.channels();
    let mut header = String::from("frequency_hz");
    for dof in 0..dofs {
        let [amplitude, phase] = ["amplitude", "phase_deg"].map(|base| numbered(base, dof, dofs));
        let _ = write!(header, ",{amplitude},{phase}");
    }
    header.push('\n');
    let lines = match lines {
        Some(lines) => lines.to_vec(),
        None => (0..spectrum.len()).collect(),
    };
    let pieces = lines.len().div_ceil(GATHERED);
    let rows = move |piece: usize| {
        let mut text = String::new();
        for &n in lines.iter().skip(piece * GATHERED).take(GATHERED) {
            let _ = write!(text, "{:?}", spectrum.frequency_hz(n));
            for dof in 0..dofs {
                let line = spectrum.line(n, dof);
                let _ = write!(text, ",{:?},{:?}", line.norm(), line.arg().to_degrees());
            }
            text.push('\n');
        }
        text
    };
    std::iter::once(header).chain((0..pieces).map(rows))
}
