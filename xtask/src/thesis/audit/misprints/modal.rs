//! Misprints of Appendix E, found by comparison with the eigenvalues of its own matrices.

use mechid_problems::steffen_rade;
use nalgebra::Complex;

use super::super::markdown::number;
use super::Remark;

/// Printed ratios y of mode 1 in table E1: the true and the identified ratio, and the printed error
/// of the identified one in per cent.
const RATIO_E1: (Complex<f64>, Complex<f64>, f64) =
    (Complex::new(1.1567, 0.3474), Complex::new(1.1576, 0.3483), 0.1052);
/// Printed ratios y of mode 2 in the reproduced table of Steffen & Rade: the true and the
/// identified ratio, and the printed error of the identified one in per cent.
const RATIO_STEFFEN_RADE: (Complex<f64>, Complex<f64>, f64) =
    (Complex::new(-0.682, 0.275), Complex::new(-0.697, 0.291), 1.32);

/// Lists the errors in tables E1, E2 and the reproduced table of Steffen & Rade (1991).
///
/// # Errors
/// The message of the eigenvalue solver.
pub fn modal() -> Result<Vec<Remark>, String> {
    let modes = steffen_rade().modes().map_err(|e| e.to_string())?;
    let zeta: Vec<String> = modes.iter().map(|m| format!("{:.4}", m.damping_ratio())).collect();
    let hertz: Vec<String> =
        modes.iter().map(|m| format!("{:.4} Hz", m.damped_frequency_hz())).collect();
    let ratio = modes[0].shape()[1] / modes[0].shape()[0];
    let written = |z: Complex<f64>| format!("{:.4} ± {:.4}i", z.re, z.im.abs());
    let errors = |(truth, found, _): (Complex<f64>, Complex<f64>, f64)| {
        let magnitude = 100.0 * (found.norm() - truth.norm()).abs() / truth.norm();
        (number(magnitude), number(100.0 * (found - truth).norm() / truth.norm()))
    };
    let (magnitude, difference) = errors(RATIO_E1);
    let (their_magnitude, their_difference) = errors(RATIO_STEFFEN_RADE);
    let remark = |texts: [String; 4]| {
        let [place, printed, right, reason] = texts;
        Remark { place, printed, right, reason }
    };
    let computed = "computed from the printed M, C, K";
    Ok(vec![
        remark([
            "E1, E2, Steffen & Rade table 2: damping factors".to_owned(),
            "mode 1: 0.4275, mode 2: 0.187".to_owned(),
            format!("{} at {}, {} at {}", zeta[0], hertz[0], zeta[1], hertz[1]),
            format!("{computed}: the two are interchanged, in all three tables alike"),
        ]),
        remark([
            "the same tables: head of the eigenvectors".to_owned(),
            "y1/y2".to_owned(),
            "y2/y1".to_owned(),
            format!("{computed}: y2/y1 = {}, y1/y2 = {}", written(ratio), written(1.0 / ratio)),
        ]),
        remark([
            "E1, E2: error of the eigenvector of mode 1".to_owned(),
            format!("{} (E1), called an error of magnitude", RATIO_E1.2),
            format!("{magnitude} for the magnitude, {difference} for the complex difference"),
            "formed from the printed ratios: the number belongs to the complex difference"
                .to_owned(),
        ]),
        remark([
            "Steffen & Rade table 2: error of the eigenvector of mode 2".to_owned(),
            RATIO_STEFFEN_RADE.2.to_string(),
            format!("{their_magnitude} for the magnitude, {their_difference} for the difference"),
            "formed from the printed ratios; the 1991 article was not at hand to decide".to_owned(),
        ]),
    ])
}
